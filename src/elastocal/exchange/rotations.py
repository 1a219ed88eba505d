"""Orientations as people write them, to rotation vectors: quaternions, Euler angles, matrices."""

import itertools
import re
from collections.abc import Collection

import numpy as np
from scipy.spatial.transform import Rotation

from elastocal.exchange.column_names import EULER, HOMOGENEOUS, MATRIX, QUATERNION, VECTOR

NO_ROTATION, VECTORS, QUATERNIONS, MATRICES, HOMOGENEOUS_MATRICES = "none", "vector", "quaternion", "matrix", "homogeneous"
_COLUMNS: dict[str, tuple[str, ...]] = {
    NO_ROTATION: (),
    VECTORS: VECTOR,
    QUATERNIONS: QUATERNION,
    MATRICES: MATRIX,
    HOMOGENEOUS_MATRICES: HOMOGENEOUS,
}
EULER_ANGLES = "euler:"
ALLOWED = (
    "none, vector, quaternion, matrix, homogeneous, or euler: with three axes such as euler:ZYX (about axes that turn with the "
    "body; small letters, euler:xyz: about fixed ones)"
)
# Rounded to four digits, a quaternion's length and a matrix' columns are off by less.
UNIT_LENGTH = 2e-3
_SEQUENCE = re.compile(r"[XYZ]{3}|[xyz]{3}")


def is_rotation(text: str) -> bool:
    """Whether a text names a notation of `ALLOWED`."""
    sequence = text.removeprefix(EULER_ANGLES)
    if sequence != text:
        repeated = any(one == other for one, other in itertools.pairwise(sequence))
        return _SEQUENCE.fullmatch(sequence) is not None and not repeated
    return text in _COLUMNS


def columns_of_rotation(notation: str, there: Collection[str]) -> tuple[str, ...]:
    """Names of the columns of an orientation.

    `notation`: of `ALLOWED`. `there`: columns that a table has: Euler angles about three different axes may be named after the
    axes, ``rx``, or ``e1..e3``.
    """
    if notation.startswith(EULER_ANGLES):
        axes = notation.removeprefix(EULER_ANGLES).lower()
        by_axis = tuple(f"r{axis}" for axis in axes)
        return by_axis if len(set(axes)) == 3 and all(name in there for name in by_axis) else EULER
    return _COLUMNS[notation]


def rotation_vectors(notation: str, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rotation vectors of orientations.

    `notation`: of `ALLOWED`, but not "none". `values` (N, columns): in the order of `columns_of_rotation`; angles in rad. Of
    homogeneous matrices the translations are left aside. Returns `vectors` (N, 3): rad; `off` (N,) of bool: whether a
    quaternion is not of length one or a matrix not a rotation, more than rounding to four digits explains.
    """
    good = np.zeros(len(values), bool)
    if notation == VECTORS:
        return values, good
    if notation.startswith(EULER_ANGLES):
        return Rotation.from_euler(notation.removeprefix(EULER_ANGLES), values).as_rotvec(), good
    if notation == QUATERNIONS:
        off = np.abs(np.linalg.norm(values, axis=1) - 1.0) > UNIT_LENGTH
        safe = np.where(off[:, None], [1.0, 0.0, 0.0, 0.0], values)
        return Rotation.from_quat(safe[:, [1, 2, 3, 0]]).as_rotvec(), off
    width = 4 if notation == HOMOGENEOUS_MATRICES else 3
    matrices = values.reshape(-1, 3, width)[:, :, :3]
    off = np.abs(np.swapaxes(matrices, 1, 2) @ matrices - np.eye(3)).max(axis=(1, 2)) > UNIT_LENGTH
    off |= np.linalg.det(matrices) < 0.0
    return Rotation.from_matrix(np.where(off[:, None, None], np.eye(3), matrices)).as_rotvec(), off
