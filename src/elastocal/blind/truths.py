"""What was sealed, opened for the scores and for nothing else."""

import hashlib
from pathlib import Path

from elastocal.errors import InputError
from elastocal.io.json_files import read_json


def opened_truths(files, manifest):
    """Open sealed files that are as promised.

    Parameters
    ----------
    files : iterable of Path
    manifest : str or Path
        A line ``sha256  name`` for each.

    Returns
    -------
    dict of str to dict
        Sealed documents by the name of the case, in its order.

    Raises
    ------
    InputError
        A file is not the one whose hash was published.
    """
    promised = dict(reversed(line.split()) for line in Path(manifest).read_text(encoding="utf-8").splitlines())
    truths = {}
    for file in sorted(files, key=lambda file: file.name):
        found = hashlib.sha256(file.read_bytes()).hexdigest()
        if promised.get(file.name) != found:
            raise InputError(file, "", f"SHA-256 {found}", f"{promised.get(file.name)}, as sealed")
        truths[file.stem] = read_json(file)
    return truths
