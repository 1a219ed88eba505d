"""Poses of a board as ``elastocal detect`` writes them, one row for each image."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from elastocal.errors import InputError
from elastocal.exchange.board_detection import POSE_COLUMNS, STD_COLUMNS
from elastocal.exchange.board_poses import BoardPoses

_NUMBERS = (*POSE_COLUMNS, *STD_COLUMNS)


def is_detected_poses(header: str) -> bool:
    """Whether a line is the header of such a table."""
    return header.startswith("image,x,y,z,")


def read_detected_poses(path: str | Path) -> BoardPoses:
    """Read a table of poses with its images and its noise.

    Raises `InputError`: a column is missing, or a cell is not a number.
    """
    with open(path, encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    if not rows:
        raise InputError(path, "", "no row", "a table of elastocal detect")
    numbers = []
    for line, row in enumerate(rows, 2):
        try:
            numbers.append([float(row[name]) for name in _NUMBERS])
        except (KeyError, TypeError, ValueError) as error:
            allowed = f"numbers in {', '.join(_NUMBERS)}"
            raise InputError(path, f"line {line}", str(error), allowed) from None
    values = np.array(numbers)
    squares = values[:, 6:] ** 2
    return BoardPoses(
        Path(path).as_posix(),
        values[:, :3],
        Rotation.from_rotvec(values[:, 3:6]).as_matrix(),
        images=tuple(row["image"] for row in rows),
        noise={
            "position_m": float(np.sqrt(squares[:, :3].mean())),
            "orientation_rad": float(np.sqrt(squares[:, 3:].mean())),
        },
    )
