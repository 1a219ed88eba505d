"""Files that appear whole or not at all."""

from __future__ import annotations

import os
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path


@contextmanager
def atomic_write(path: str | Path) -> Iterator[str]:
    """Write beside a file, then rename.

    Parameters
    ----------
    path : str
        Where the file shall be once it is complete.

    Yields
    ------
    str
        Where to write it. If the block raises, nothing is left behind.
    """
    partial = f"{path}.partial"
    try:
        yield partial
        os.replace(partial, path)
    finally:
        with suppress(FileNotFoundError):
            os.remove(partial)


def write_text(path: str | Path, text: str) -> None:
    """Write a text; the file appears whole or not at all.

    Parameters
    ----------
    path : str
    text : str
    """
    with atomic_write(path) as partial, open(partial, "w", encoding="utf-8") as file:
        file.write(text)
