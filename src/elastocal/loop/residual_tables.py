"""The residuals table of a campaign as everything reads it that states or draws errors: without the gross errors in it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from elastocal.io.storage import read_table
from elastocal.loop.schemas import residuals

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path


def read_residuals(path: str | Path, joints: int) -> dict[str, np.ndarray]:
    """Columns of a residuals table, of the rows that are no gross errors."""
    columns = read_table(path, residuals(joints))
    return {name: values[~columns["gross_error"]] for name, values in columns.items()}


def worst_measurement(table: Mapping[str, np.ndarray]) -> int:
    """Row of a residuals table with the largest position error of the declared model."""
    return int(np.argmax(np.linalg.norm([table[f"before_d{axis}"] for axis in "xyz"], axis=0)))


def angles_of(table: Mapping[str, np.ndarray], joints: int) -> np.ndarray:
    """Joint angles (N, n) of a residuals table, as the model of the robot counts them, rad."""
    return np.column_stack([table[f"q{joint}"] for joint in range(1, joints + 1)])
