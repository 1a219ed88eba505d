"""Samples of easy_handeye: pairs of transforms, of which ``tracking`` is the board in the
camera [1]_.

References
----------
.. [1] easy_handeye2, SampleList.msg written as YAML; easy_handeye of ROS 1 calls the lists
   ``hand_world_samples`` and ``camera_marker_samples``.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from elastocal.errors import InputError
from elastocal.exchange.board_poses import BoardPoses

_SAMPLES = "samples"
_BOARD = "tracking"
_BOARDS_OF_ROS_1 = "camera_marker_samples"
_ALLOWED = "translation: {x, y, z} in m and rotation: {x, y, z, w}"


def is_easy_handeye_samples(document: Any) -> bool:
    """Whether a YAML document is a file of samples of easy_handeye."""
    return isinstance(document, dict) and (
        isinstance(document.get(_SAMPLES), list) or _BOARDS_OF_ROS_1 in document
    )


def read_easy_handeye_samples(document: Any, path: str | Path) -> BoardPoses:
    """Read the poses of the board; the program saves no joint angles.

    Raises `InputError`: there is no sample, or one has no such transform.
    """
    transforms = document.get(_SAMPLES)
    if transforms is None:
        boards = document[_BOARDS_OF_ROS_1]
        boards = (
            boards.get("transforms", boards) if isinstance(boards, dict) else boards
        )
        transforms = [{_BOARD: board} for board in boards]
    if not transforms:
        raise InputError(path, "", "no sample", _ALLOWED)
    positions = []
    quaternions = []
    for number, sample in enumerate(transforms, 1):
        key = f"sample {number}, {_BOARD}"
        board = sample.get(_BOARD) if isinstance(sample, dict) else None
        positions.append(_read_vector(board, "translation", "xyz", path, key))
        quaternions.append(_read_vector(board, "rotation", "xyzw", path, key))
    lengths = np.linalg.norm(quaternions, axis=1)
    if (lengths == 0.0).any():
        sample = int(np.argmin(lengths)) + 1
        raise InputError(path, f"sample {sample}", "a quaternion of length 0", _ALLOWED)
    rotation = Rotation.from_quat(np.array(quaternions)).as_matrix()
    return BoardPoses(Path(path).as_posix(), np.array(positions), rotation)


def _read_vector(
    transform: Any, part: str, axes: Sequence[str], path: str | Path, key: str
) -> list[float]:
    """Read the numbers of one part of a transform."""
    try:
        return [float(transform[part][axis]) for axis in axes]
    except (KeyError, TypeError, ValueError):
        raise InputError(path, key, f"no {part}", _ALLOWED) from None
