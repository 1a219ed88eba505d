"""The one error that bad input raises."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pathlib import Path


class InputError(ValueError):
    """Something that a user gave cannot be used; the message is one line.

    Parameters
    ----------
    source : str
        The file, or the name of the thing, that holds the fault.
    key : str
        The key, row or column inside it; empty where the whole file is meant.
    found : str
        What stands there.
    allowed : str
        What may stand there.
    """

    def __init__(self, source: str | Path, key: str, found: str, allowed: str) -> None:
        self.source, self.key, self.found, self.allowed = str(source), key, found, allowed
        where = f"{source}: {key}" if key else f"{source}"
        super().__init__(" ".join(f"{where}: found {found}; allowed: {allowed}".split()))
