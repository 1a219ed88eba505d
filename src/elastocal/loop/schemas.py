"""Schemas of the tables that the loop stores, and access to stored residuals.

`schemas.csv` beside this file has their columns.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from elastocal.io.storage import read_schemas, read_table
from elastocal.mechanics.components import list_joint_columns

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

SCHEMAS = read_schemas(__file__)
# Measurements of a campaign. They differ from the user's file in two columns: targets are
# numbers, and joint angles are those of the chain.
MEASUREMENTS = SCHEMAS["measurements"]
STEPS = SCHEMAS["steps"]
# Residuals of every measurement before and after the diagnosis; positions are in base
# axes.
RESIDUALS = SCHEMAS["residuals"]


def read_residuals(path: str | Path, joints: int) -> dict[str, np.ndarray]:
    """Read the columns of a residuals table, without the rows of gross errors."""
    return drop_gross_errors(read_table(path, RESIDUALS.for_joints(joints)))


def drop_gross_errors(columns: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Drop the rows of gross errors from the columns of a residuals table."""
    kept = ~columns["gross_error"]
    return {name: values[kept] for name, values in columns.items()}


def find_worst_measurement(table: Mapping[str, np.ndarray]) -> int:
    """Find the row of a residuals table with the largest position error before the
    calibration."""
    residual = [table[f"before_d{axis}"] for axis in "xyz"]
    return int(np.argmax(np.linalg.norm(residual, axis=0)))


def stack_joint_angles(table: Mapping[str, np.ndarray], joints: int) -> np.ndarray:
    """Return the joint angles (N, n) of a residuals table, those of the chain, rad."""
    return np.column_stack([table[name] for name in list_joint_columns(joints)])


def find_worst_joint_angles(table: Mapping[str, np.ndarray], joints: int) -> np.ndarray:
    """Find the joint angles (n,) of the worst measurement of a residuals table."""
    return stack_joint_angles(table, joints)[find_worst_measurement(table)]
