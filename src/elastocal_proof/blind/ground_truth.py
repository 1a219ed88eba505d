"""The sealed ground truth of the cases, read for the scores and the oracle only."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import TYPE_CHECKING, Any

from elastocal.errors import InputError
from elastocal.io.json_files import read_json

if TYPE_CHECKING:
    from collections.abc import Iterable


def load_ground_truth(files: Iterable[Path], manifest: str | Path) -> dict[str, dict[str, Any]]:
    """Read sealed files whose hashes are those that were published.

    `manifest`: a line ``sha256 name`` for each. Returns sealed documents by the name of the case, in its order. Raises
    `InputError`: a file is not the one whose hash was published.
    """
    lines = Path(manifest).read_text(encoding="utf-8").splitlines()
    published = {name: digest for digest, name in map(str.split, lines)}
    truths = {}
    for file in sorted(files, key=lambda file: file.name):
        found = hashlib.sha256(file.read_bytes()).hexdigest()
        if published.get(file.name) != found:
            raise InputError(file, "", f"SHA-256 {found}", f"{published.get(file.name)}, as sealed")
        truths[file.stem] = read_json(file)
    return truths
