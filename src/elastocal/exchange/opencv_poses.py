"""Poses of a board that a script with OpenCV saved by ``numpy.savez``.

``cv2.calibrateCamera`` and ``cv2.solvePnP`` return the arrays ``rvecs`` and ``tvecs``.
Many scripts save joint angles in the same file. A file with a pickled object is refused.
"""

from __future__ import annotations

import zipfile
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from elastocal.errors import InputError
from elastocal.exchange.board_poses import BoardPoses

# Names of the arrays that scripts use.
_ROTATIONS = ("rvecs", "rvec", "R_target2cam")
_POSITIONS = ("tvecs", "tvec", "t_target2cam")
_ANGLES = ("q", "joints", "joint_angles", "joint_positions")
_ALLOWED = "arrays rvecs and tvecs, as cv2.calibrateCamera returns them"


def read_opencv_poses(path: str | Path) -> BoardPoses:
    """Read poses of the board, and joint angles if there are any.

    Raises `InputError`: the file is not an archive of NumPy, an array is missing or has
    the wrong size, or an array is pickled.
    """
    try:
        # Loading a pickle runs code from the file; refuse pickled objects.
        with np.load(path, allow_pickle=False) as archive:
            arrays = {name: archive[name] for name in archive.files}
    except (OSError, ValueError, zipfile.BadZipFile, AttributeError) as error:
        raise InputError(path, "", f"no arrays ({error})", _ALLOWED) from None
    position = _find_array(arrays, _POSITIONS, path).reshape(-1, 3)
    rotation = _find_array(arrays, _ROTATIONS, path)
    count = len(position)
    if rotation.size == 9 * count:
        matrices = rotation.reshape(-1, 3, 3)
    elif rotation.size == 3 * count:
        matrices = Rotation.from_rotvec(rotation.reshape(-1, 3)).as_matrix()
    else:
        counts = f"{rotation.size} numbers of rotations for {count} positions"
        raise InputError(path, _ROTATIONS[0], counts, "3 or 9 for each position")
    angles = None
    if any(name in arrays for name in _ANGLES):
        angles = _find_array(arrays, _ANGLES, path)
        if angles.ndim != 2 or len(angles) != count:
            shape = f"an array {angles.shape} of joint angles"
            allowed = f"{count} rows, one for each pose, in rad"
            raise InputError(path, "", shape, allowed)
    return BoardPoses(Path(path).as_posix(), position, matrices, angles)


def _find_array(
    arrays: dict[str, np.ndarray], names: tuple[str, ...], path: str | Path
) -> np.ndarray:
    """Return the array with the first of these names that the file has, as floats."""
    name = next((name for name in names if name in arrays), None)
    if name is None:
        available = f"arrays {', '.join(arrays) or 'none'}"
        raise InputError(path, "", available, f"{_ALLOWED}; no {' or '.join(names)}")
    try:
        return np.asarray(arrays[name], float)
    except (TypeError, ValueError):
        raise InputError(path, name, "no numbers", _ALLOWED) from None
