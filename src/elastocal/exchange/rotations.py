"""Orientations as people write them, to rotation vectors: which notation a table has, and what it says."""

import itertools
import re
from collections.abc import Collection, Mapping

import numpy as np
from scipy.spatial.transform import Rotation

from elastocal.errors import InputError
from elastocal.exchange.csv_dialect import TextTable

VECTOR = ("rx", "ry", "rz")
QUATERNION = ("qw", "qx", "qy", "qz")
EULER = ("e1", "e2", "e3")
MATRIX = tuple(f"r{i}{j}" for i in (1, 2, 3) for j in (1, 2, 3))
HOMOGENEOUS = tuple(f"t{i}{j}" for i in (1, 2, 3) for j in (1, 2, 3, 4))
NO_ROTATION, QUATERNIONS, HOMOGENEOUS_MATRICES, EULER_ANGLES = "none", "quaternion", "homogeneous", "euler:"
# Columns of each notation; those that say by themselves what they are come first.
_COLUMNS: dict[str, tuple[str, ...]] = {
    HOMOGENEOUS_MATRICES: HOMOGENEOUS,
    QUATERNIONS: QUATERNION,
    "matrix": MATRIX,
    "vector": VECTOR,
    NO_ROTATION: (),
}
_CERTAIN = (HOMOGENEOUS_MATRICES, QUATERNIONS, "matrix")
_ALLOWED = (
    "none, vector, quaternion, matrix, homogeneous, or euler: with three axes such as euler:ZYX (about axes that turn with the "
    "body; small letters, euler:xyz: about fixed ones)"
)
# Rounded to four digits, a quaternion's length and a matrix' columns are off by less.
UNIT_LENGTH = 2e-3
# Columns that a table may have in two meanings: external axes E1 to E3 beside an orientation.
_OTHER_ANGLES = (("A", "B", "C"), ("W", "P", "R"), ("O", "A", "T"))


def columns_of_rotation(notation: str, there: Collection[str]) -> tuple[str, ...]:
    """Names of the columns of an orientation in a notation.

    `there`: columns that a table has: Euler angles about three different axes may be named after the axes, ``rx``, or
    ``e1..e3``.
    """
    if not notation.startswith(EULER_ANGLES):
        return _COLUMNS[notation]
    axes = notation.removeprefix(EULER_ANGLES).lower()
    by_axis = tuple(f"r{axis}" for axis in axes)
    return by_axis if len(set(axes)) == 3 and all(name in there for name in by_axis) else EULER


def find_rotation(text: TextTable, columns: Mapping[str, str], mapped: Mapping[str, str], notation: str | None) -> str:
    """Notation of the orientations of a table: the one that is stated, or the one that the names of columns leave.

    `columns`: headers by name. `mapped`: those of them that options state. Raises `InputError` where it is ambiguous.
    """
    if notation is not None:
        axes = notation.removeprefix(EULER_ANGLES)
        turns = re.fullmatch(r"[XYZ]{3}|[xyz]{3}", axes) and all(one != other for one, other in itertools.pairwise(axes))
        if not (turns if axes != notation else notation in _COLUMNS):
            raise InputError("--rotation", "", repr(notation), _ALLOWED)
        if columns_of_rotation(notation, columns) == EULER:
            _check_external_axes(text, columns, mapped)
        return notation
    for certain in _CERTAIN:
        if all(name in columns for name in _COLUMNS[certain]):
            return certain
    if part := [columns[name] for name in QUATERNION if name in columns]:
        allowed = "--column qw=NAME and such for what is missing, or --rotation none"
        raise InputError(text.path, "header", f"a part of a quaternion, {', '.join(part)}", allowed)
    if angles := [columns[name] for name in (*VECTOR, *EULER) if name in columns]:
        allowed = f"--rotation vector, euler:ZYX, euler:xyz … or none: {_ALLOWED}"
        raise InputError(text.path, "header", f"orientations {', '.join(angles)} of an unknown notation", allowed)
    return NO_ROTATION


def _check_external_axes(text: TextTable, columns: Mapping[str, str], mapped: Mapping[str, str]) -> None:
    """Ask where angles ``E1`` to ``E3`` may be external axes, as other columns look like the orientation."""
    plain = {re.split(r"[\[(]", header)[0].strip().upper(): header for header in text.columns}
    guessed = [columns[name] for name in EULER if name in columns and name not in mapped]
    others = [[plain[letter] for letter in letters] for letters in _OTHER_ANGLES if plain.keys() >= {*letters}]
    if guessed and (others or plain.keys() & {"E4", "E5", "E6"}):
        other_names = others[0] if others else ["NAME", "NAME", "NAME"]
        allowed = " ".join(f"--column {name}={header!r}" for name, header in zip(EULER, other_names, strict=True))
        own = " or ".join([f"{', '.join(guessed)} (external axes?)", *(", ".join(each) for each in others)])
        raise InputError(text.path, "header", f"orientations in {own}", f"{allowed}, or the same with {', '.join(guessed)}")


def rotation_vectors(notation: str, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rotation vectors of orientations in a notation that is not "none".

    `values` (N, columns): in the order of `columns_of_rotation`; angles in rad. Of homogeneous matrices the translations are
    left aside. Returns `vectors` (N, 3): rad; `off` (N,) of bool: whether a quaternion is not of length one or a matrix not a
    rotation, more than rounding to four digits explains.
    """
    off = np.zeros(len(values), bool)
    if notation == "vector":
        return values, off
    if notation.startswith(EULER_ANGLES):
        return Rotation.from_euler(notation.removeprefix(EULER_ANGLES), values).as_rotvec(), off
    if notation == QUATERNIONS:
        off = np.abs(np.linalg.norm(values, axis=1) - 1.0) > UNIT_LENGTH
        safe = np.where(off[:, None], [1.0, 0.0, 0.0, 0.0], values)
        return Rotation.from_quat(safe, scalar_first=True).as_rotvec(), off
    matrices = values.reshape(len(values), 3, -1)[:, :, :3]
    off = np.abs(np.swapaxes(matrices, 1, 2) @ matrices - np.eye(3)).max(axis=(1, 2)) > UNIT_LENGTH
    off |= np.linalg.det(matrices) < 0.0
    return Rotation.from_matrix(np.where(off[:, None, None], np.eye(3), matrices)).as_rotvec(), off
