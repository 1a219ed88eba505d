"""A file of target poses of the end effector, with loads and postures.

Columns ``x, y, z`` (m) and ``rx, ry, rz`` (rotation vector, rad) of the last measuring
point in base axes; optionally ``fx .. mz`` (N, N m), its load, or the forces alone if all
moments are zero; and optionally ``q1 .. qn`` (rad, as the controller reports them), joint
angles of the posture in which the robot shall reach the pose.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from elastocal.campaigns.measurements import LARGEST_ROTATION_RAD
from elastocal.campaigns.reading import find_degrees
from elastocal.campaigns.tables import Cells, Dialect, TextTable, read_text_table
from elastocal.errors import InputError, suggest_names
from elastocal.mechanics.components import WRENCH_NAMES
from elastocal.mechanics.robot import Robot

_POSE = ("x", "y", "z", "rx", "ry", "rz")
# Status of a corrected target.
OK = "ok"
# Status of a corrected target without a bound on its error; the reason follows.
NO_BOUND = "no bound: "
# Upper bound on a coordinate. No arm reaches farther, so that a larger one is not in
# metres.
_FARTHEST_M = 10.0


@dataclass(frozen=True)
class TargetPath:
    """N target poses.

    Attributes
    ----------
    position : (N, 3), m, base axes.
    rotation : (N, 3, 3).
    start : joint angles of the posture, (N, n), rad; None if the file has none.
    wrench : load, (N, 6), N and N m; None if the file has none.
    lines : line of the file of each pose.
    """

    position: np.ndarray
    rotation: np.ndarray
    start: np.ndarray | None
    wrench: np.ndarray | None
    lines: tuple[int, ...]

    def __len__(self) -> int:
        return len(self.position)


def read_target_path(path: str | Path, joints: int) -> TargetPath:
    """Read a file of target poses.

    Parameters
    ----------
    path : CSV file
    joints : number of joints of the robot

    Raises
    ------
    InputError
        A column is missing, unknown or incomplete, a cell is not a number, or no arm
        reaches a pose.
    """
    angles = tuple(f"q{joint}" for joint in range(1, joints + 1))
    text = read_text_table(path, lambda _: True, Dialect("comma", "point"))
    _check_columns(text, angles)
    cells = text.cells({name: name for name in text.columns}, {})
    pose = cells.matrix(_POSE)
    position = pose[:, :3]
    rotation_vector = pose[:, 3:]
    _check_size(text, "position", np.abs(position).max(axis=1), _FARTHEST_M, "metres")
    allowed = "a rotation vector in rad, not degrees"
    angle = np.linalg.norm(rotation_vector, axis=1)
    _check_size(text, "turn", angle, LARGEST_ROTATION_RAD, allowed)
    has_moments = bool(set(WRENCH_NAMES[3:]) & set(text.columns))
    wrench_names = WRENCH_NAMES if has_moments else WRENCH_NAMES[:3]
    wrench = _read_all_or_none(text, cells, wrench_names)
    if wrench is not None:
        wrench = np.pad(wrench, ((0, 0), (0, 6 - wrench.shape[1])))
    rotation = Rotation.from_rotvec(rotation_vector).as_matrix()
    start = _read_all_or_none(text, cells, angles)
    return TargetPath(position, rotation, start, wrench, text.lines)


def _check_columns(text: TextTable, angles: tuple[str, ...]) -> None:
    """Refuse a table without a pose, or with a column that no target has."""
    header = f"line {text.dialect.header}"
    for name in _POSE:
        if name not in text.columns:
            raise InputError(
                text.path,
                header,
                f"no column {name!r}",
                (
                    f"{', '.join(_POSE)}: position in m and rotation vector in rad, base"
                    " axes, separated by commas"
                ),
            )
    allowed_names = (*_POSE, *WRENCH_NAMES, *angles)
    for name in text.columns:
        if name not in allowed_names:
            raise InputError(
                text.path,
                header,
                f"the unknown column {name!r}",
                suggest_names(name, allowed_names),
            )


def _check_size(
    text: TextTable, quantity: str, size: np.ndarray, largest: float, unit: str
) -> None:
    """Refuse the largest of the sizes (N,) of a quantity if it exceeds a bound."""
    row = int(np.argmax(size))
    if size[row] > largest:
        raise InputError(
            text.path,
            f"line {text.lines[row]}",
            f"a {quantity} of {size[row]:g}",
            f"{unit}, {largest:.3g} at most",
        )


def _read_all_or_none(
    text: TextTable, cells: Cells, names: tuple[str, ...]
) -> np.ndarray | None:
    """Read columns, ndarray (N, len(names)); None if the table has none of them."""
    present = [name for name in names if name in text.columns]
    missing = [name for name in names if name not in text.columns]
    if not present:
        return None
    if missing:
        problem = f"{', '.join(present)} without {', '.join(missing)}"
        header = f"line {text.dialect.header}"
        raise InputError(text.path, header, problem, "all of them or none")
    return cells.matrix(names)


def read_target_path_for(path: str | Path, robot: Robot) -> TargetPath:
    """Read a file of target poses for a robot; joint angles in degrees are refused too."""
    targets = read_target_path(path, robot.joints)
    if targets.start is None:
        return targets
    in_degrees = find_degrees(targets.start, robot)
    if in_degrees.any():
        row, joint = np.argwhere(in_degrees)[0]
        low, high = robot.joint_limits[joint]
        raise InputError(
            path,
            f"line {targets.lines[row]}",
            f"q{joint + 1} looks like degrees: {targets.start[row, joint]:g}",
            f"rad, of a joint that goes from {low:.2f} to {high:.2f} rad",
        )
    return targets
