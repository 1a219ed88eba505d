"""Variables of MAT files; what is none, or is damaged, is one line."""

import io
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import scipy

from elastocal.campaigns.public_data import LARGEST_BYTES
from elastocal.counting import counted
from elastocal.errors import InputError
from elastocal.io.texts import read_bytes

_KIND = "a MAT file of version 5"


def read_mat(path: str | Path, names: Sequence[str]) -> dict[str, Any]:
    """Some variables of a MAT file.

    `names`: of the variables; any that the file does not have is left out. Raises `InputError`: no file, or one that scipy
    cannot read as a whole.
    """
    content = read_bytes(path, LARGEST_BYTES, _KIND)
    # The stubs of scipy know paths alone.
    stream: Any = io.BytesIO(content)
    try:
        found: dict[str, Any] = scipy.io.loadmat(stream, variable_names=list(names))
    except Exception:
        # The reader lets through whatever broken bytes make of its parts; its words say nothing of the file.
        raise InputError(
            path, "", f"no readable MAT file, or one that is damaged ({counted(len(content), 'byte')})", _KIND
        ) from None
    return {name: found[name] for name in names if name in found}
