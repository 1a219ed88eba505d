"""Samples of MoveIt's hand-eye calibration: a list of pairs of matrices [1]_.

References
----------
.. [1] moveit_calibration, "Save samples" of its panel in RViz: ``object_wrt_sensor`` is
   the board in the camera, ``effector_wrt_world`` the flange in the base, each a 4 x 4
   matrix, row by row.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from elastocal.errors import InputError
from elastocal.exchange.board_poses import BoardPoses

_BOARD = "object_wrt_sensor"


def is_moveit_samples(document: Any) -> bool:
    """Whether a YAML document is a file of samples of MoveIt."""
    return (
        isinstance(document, list)
        and bool(document)
        and isinstance(document[0], dict)
        and _BOARD in document[0]
    )


def read_moveit_samples(document: Any, path: str | Path) -> BoardPoses:
    """Read the poses of the board; MoveIt saves joint angles in a file of their own.

    Raises `InputError`: a sample has no matrix of 16 numbers.
    """
    matrices = []
    for number, sample in enumerate(document, 1):
        numbers = sample.get(_BOARD) if isinstance(sample, dict) else None
        try:
            matrices.append(np.asarray(numbers, float).reshape(4, 4))
        except (TypeError, ValueError):
            key = f"sample {number}, {_BOARD}"
            raise InputError(path, key, repr(numbers), "16 numbers") from None
    poses = np.stack(matrices)
    return BoardPoses(Path(path).as_posix(), poses[:, :3, 3], poses[:, :3, :3])
