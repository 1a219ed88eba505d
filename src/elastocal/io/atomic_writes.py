"""Write files atomically: a file appears complete or not at all, and never replaces a
link, a pipe or a device."""

import fcntl
import os
import re
import secrets
import shutil
import stat
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from elastocal.errors import InputError
from elastocal.io.texts import describe_file_kind

_PARTIAL = re.compile(r"\.[0-9a-f]{16}\.partial$")


def check_places(*paths: str | Path, top: Path | None = None) -> None:
    """Refuse to write a file in the place of a link, a pipe or anything else that is no
    regular file.

    A folder between the file and `top`, which the user named, must not be a link.
    """
    folders = dict.fromkeys(
        folder
        for path in paths
        for folder in Path(path).parents
        if top in folder.parents
    )
    for folder in folders:
        if folder.is_symlink():
            raise InputError(folder, "", "a link", "a folder")
    for path in paths:
        try:
            mode = os.lstat(path).st_mode
        except FileNotFoundError:
            continue
        except ValueError as error:
            raise InputError(path, "", str(error), "a place for a file") from None
        if not stat.S_ISREG(mode):
            raise InputError(
                path,
                "",
                describe_file_kind(mode),
                "a place for a file: a new name, or that of a file",
            )


def check_folder(folder: str | Path) -> None:
    """Refuse a folder that contains links, pipes or devices at any depth, because files
    that are written there would go elsewhere."""
    # Another run may remove an entry that was just listed.
    with suppress(FileNotFoundError), os.scandir(folder) as entries:
        for entry in entries:
            if entry.is_dir(follow_symlinks=False):
                check_folder(entry.path)
            elif not entry.is_file(follow_symlinks=False):
                check_places(entry.path)


def remove_partials(folder: str | Path) -> None:
    """Remove the partial files that killed processes have left below a folder.

    A process that writes a partial file holds a lock on it. Therefore the files of
    living processes, such as a certificate that is being written, stay.
    """
    for path in Path(folder).rglob("*.partial"):
        if not _PARTIAL.search(path.name) or _is_being_written(path):
            continue
        if path.is_dir():
            shutil.rmtree(path)
        else:
            path.unlink()


@contextmanager
def write_atomically(path: str | Path, *, empty: bool = False) -> Iterator[str]:
    """Give the block an unpredictable name in the same folder to write to, and rename
    the file afterwards. If the block raises, nothing is left behind.

    A block that writes nothing is an OSError, unless the file may be `empty`.
    """
    check_places(path)
    partial = _partial_name(path)
    flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW
    try:
        os.close(os.open(partial, flags, 0o666))
    except FileNotFoundError as error:
        # The folder is missing. The user knows the name of the file alone.
        raise FileNotFoundError(error.errno, error.strerror, str(path)) from None
    try:
        with _lock_while_writing(partial):
            yield partial
            if not empty and not os.path.getsize(partial):
                raise FileNotFoundError(2, "nothing that was written", str(path))
            os.replace(partial, path)
    finally:
        with suppress(FileNotFoundError):
            os.remove(partial)


@contextmanager
def write_together(folder: str | Path, names: Iterable[str]) -> Iterator[Path]:
    """Write files that belong together: the block writes them, under these names, to
    the folder that it is given.

    A new folder appears with all files. In an existing folder the files of these names
    are replaced, in this order, after all old ones were removed, so that a killed run
    leaves no old file next to a new one.
    """
    folder = Path(os.path.abspath(folder))
    names = [*names]
    check_places(*(folder / name for name in names))
    if os.path.lexists(folder) and not folder.is_dir():
        raise InputError(
            folder,
            "",
            describe_file_kind(os.lstat(folder).st_mode),
            "a folder, or a new name",
        )
    is_new = not folder.exists()
    folder.parent.mkdir(parents=True, exist_ok=True)
    partial = Path(_partial_name(folder if is_new else folder / names[0]))
    partial.mkdir()
    try:
        with _lock_while_writing(partial):
            yield partial
            if is_new:
                partial.rename(folder)
                return
            check_places(*(folder / name for name in names))
            for name in names:
                (folder / name).unlink(missing_ok=True)
            for name in names:
                with suppress(FileNotFoundError):
                    (partial / name).rename(folder / name)
    finally:
        shutil.rmtree(partial, ignore_errors=True)


def write_text(path: str | Path, text: str) -> None:
    """Write a text in UTF-8, atomically."""
    with (
        write_atomically(path, empty=not text) as partial,
        open(partial, "w", encoding="utf-8") as file,
    ):
        file.write(text)


@contextmanager
def _lock_while_writing(partial: str | Path) -> Iterator[None]:
    """Hold a lock on a partial file or folder. The system releases it however the
    process ends."""
    descriptor = os.open(partial, os.O_RDONLY | os.O_NOFOLLOW)
    try:
        # A file system without locks gives no protection, but it is no reason to fail.
        with suppress(OSError):
            fcntl.flock(descriptor, fcntl.LOCK_SH)
        yield
    finally:
        os.close(descriptor)


def _is_being_written(partial: Path) -> bool:
    """Whether a living process holds the lock of a partial file or folder."""
    try:
        descriptor = os.open(partial, os.O_RDONLY | os.O_NOFOLLOW)
    except OSError:
        return False
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except OSError:
        return False
    finally:
        os.close(descriptor)
    return False


def _partial_name(path: str | Path) -> str:
    return f"{path}.{secrets.token_hex(8)}.partial"
