"""The residuals table of a campaign as everything reads it that states or draws errors: without the gross errors in it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from elastocal.io.storage import read_table
from elastocal.loop.schemas import residuals

if TYPE_CHECKING:
    from pathlib import Path

    import numpy as np


def read_residuals(path: str | Path, joints: int) -> dict[str, np.ndarray]:
    """Columns of a residuals table, of the rows that are no gross errors."""
    columns = read_table(path, residuals(joints))
    return {name: values[~columns["gross_error"]] for name, values in columns.items()}
