"""Where files of a campaign may lie: in its folder, wherever links lead, for folders of other people are read too."""

from pathlib import Path


def is_file(path: str | Path) -> bool:
    """Whether a path is that of a regular file; False too for what no path can be."""
    try:
        return Path(path).is_file()
    except (OSError, ValueError):
        # A name that is too long, or with a null character.
        return False


def is_file_in(path: str | Path, *folders: str | Path) -> bool:
    """Whether a path is that of a regular file in or below one of some folders.

    `path`, `*folders`: links are followed, on both sides.
    """
    return is_file(path) and any(Path(path).resolve().is_relative_to(Path(folder).resolve()) for folder in folders)
