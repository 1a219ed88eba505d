"""A file of target poses of the end effector, with loads and postures.

Columns ``x, y, z`` (m) and ``rx, ry, rz`` (rotation vector, rad) of the last measuring
point in base axes; optionally ``fx .. mz`` (N, N m), its load, or the forces alone if all
moments are zero; and optionally ``q1 .. qn`` (rad, as the controller reports them), joint
angles of the posture in which the robot shall reach the pose. A table of another program
is read as `measurement_table` reads measurements: its units and the notation of its
orientations must be stated, by headers or by options.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from elastocal.campaigns.measurements import LARGEST_ROTATION_RAD
from elastocal.campaigns.reading import find_degrees
from elastocal.campaigns.tables import Cells, TextTable
from elastocal.errors import InputError, suggest_names
from elastocal.exchange.column_names import (
    NO_ROTATION,
    POSITION,
    VECTOR,
    find_columns,
    find_euler_columns,
    find_rotation,
    find_scales,
    find_units,
)
from elastocal.exchange.pose_table import (
    PoseTable,
    TableOptions,
    check_option_names,
    read_cells,
    read_rotation_vectors,
)
from elastocal.mechanics.components import WRENCH_NAMES, list_joint_columns
from elastocal.mechanics.robot import Robot

_POSE = (*POSITION, *VECTOR)
# Units of a table with the names that elastocal writes, separated by commas.
_USUAL_UNITS = {"lengths": "m", "angles": "rad"}
_AS_RECOGNIZED = TableOptions()
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

    @property
    def load(self) -> np.ndarray:
        """(N, 6) loads, N and N m; zero if the file has none."""
        return np.zeros((len(self), 6)) if self.wrench is None else self.wrench

    def select(self, chosen: np.ndarray) -> "TargetPath":
        """Select poses by an (N,) bool array."""
        return TargetPath(
            self.position[chosen],
            self.rotation[chosen],
            None if self.start is None else self.start[chosen],
            None if self.wrench is None else self.wrench[chosen],
            tuple(self.lines[row] for row in np.flatnonzero(chosen)),
        )


def read_target_path(
    path: str | Path,
    joints: int,
    options: TableOptions = _AS_RECOGNIZED,
    robot: Robot | None = None,
) -> TargetPath:
    """Read a file of target poses.

    Parameters
    ----------
    path : CSV file
    joints : number of joints of the robot
    options : how a table of another program is read
    robot : robot whose joints columns may be named after

    Raises
    ------
    InputError
        A column is missing, unknown or incomplete, a unit or notation is not stated, a
        cell is not a number, or no arm reaches a pose.
    """
    check_option_names(options)
    angles = tuple(list_joint_columns(joints))
    table, options = _find_poses(read_cells(path, options), angles, options, robot)
    text = table.text
    units = find_units(
        text,
        table.columns,
        table.with_units,
        table.stated_units,
        options.units,
        robot,
    )
    cells = text.cells(table.columns, find_scales(units))
    position = cells.matrix(table.position)
    rotation_vector = read_rotation_vectors(cells, table)
    _check_size(text, "position", np.abs(position).max(axis=1), _FARTHEST_M, "metres")
    allowed = "a rotation vector in rad, not degrees"
    angle = np.linalg.norm(rotation_vector, axis=1)
    _check_size(text, "turn", angle, LARGEST_ROTATION_RAD, allowed)
    has_moments = bool({*WRENCH_NAMES[3:]} & {*table.columns})
    wrench_names = WRENCH_NAMES if has_moments else WRENCH_NAMES[:3]
    wrench = _read_all_or_none(table, cells, wrench_names)
    if wrench is not None:
        wrench = np.pad(wrench, ((0, 0), (0, 6 - wrench.shape[1])))
    rotation = Rotation.from_rotvec(rotation_vector).as_matrix()
    start = _read_all_or_none(table, cells, angles)
    return TargetPath(position, rotation, start, wrench, text.lines)


def build_target_path(
    poses: np.ndarray, start: np.ndarray | None, wrench: np.ndarray | None
) -> TargetPath:
    """Build a path of poses that no file states; lines count from 1.

    Parameters
    ----------
    poses : (N, 6) positions, m, and rotation vectors, rad, base axes.
    start : (N, n) joint angles of the postures, rad; None if free.
    wrench : (N, 6) loads, N and N m; None for no loads.

    Raises
    ------
    InputError
        A pose is not finite or farther than any arm reaches.
    """
    largest = np.r_[np.full(3, _FARTHEST_M), np.full(3, LARGEST_ROTATION_RAD)]
    # A comparison with NaN is false, so that NaN is refused too.
    wrong = ~(np.abs(poses) <= largest)
    if wrong.any():
        row, column = np.argwhere(wrong)[0]
        name = _POSE[column]
        raise InputError(
            "path",
            f"row {row + 1}, column {name}",
            f"{poses[row, column]:g}",
            f"{largest[column]:.3g} at most, in m or rad",
        )
    # The table of a caller may be read-only, which scipy does not accept.
    rotation = Rotation.from_rotvec(poses[:, 3:].copy()).as_matrix()
    lines = tuple(range(1, len(poses) + 1))
    return TargetPath(poses[:, :3], rotation, start, wrench, lines)


def _find_poses(
    text: TextTable,
    angles: Sequence[str],
    options: TableOptions,
    robot: Robot | None,
) -> tuple[PoseTable, TableOptions]:
    """Find out what the columns of a table are; refuse one that is missing or that no
    target has.

    Returns the table, and the options with the units of a table that elastocal writes.
    """
    mapped = find_euler_columns(text, options.rotation) | dict(options.columns)
    columns, stated_units = find_columns(text, mapped, robot)
    usual_names = (*_POSE, *WRENCH_NAMES, *angles)
    used_columns = {name: columns[name] for name in usual_names if name in columns}
    is_usual = text.dialect.separator == "comma" and all(
        name == header and name not in stated_units
        for name, header in used_columns.items()
    )
    if is_usual and not (options.columns or options.units or options.rotation):
        options = replace(options, units=_USUAL_UNITS, rotation="vector")
    rotation = find_rotation(text, columns, options.rotation)
    table = PoseTable(text, columns, stated_units, rotation)
    _check_columns(table, (*WRENCH_NAMES, *angles))
    return table, options


def _check_columns(table: PoseTable, optional: Sequence[str]) -> None:
    """Refuse a table without a pose, or with a column that no target has; `optional`:
    names of the columns that it may have beside the pose."""
    text = table.text
    key = f"line {text.dialect.header}"
    allowed = (
        f"{', '.join(_POSE)}: position in m and rotation vector in rad, base axes,"
        " separated by commas; or of another table --lengths mm --angles deg --rotation"
        " euler:ZYX and such"
    )
    if table.rotation == NO_ROTATION:
        raise InputError(text.path, key, "no orientation", allowed)
    pose = (*table.position, *table.orientation)
    for name in pose:
        if name not in table.columns:
            raise InputError(text.path, key, f"no column {name!r}", allowed)
    names = (*pose, *optional)
    headers = [table.columns[name] for name in names if name in table.columns]
    for header in text.columns:
        if header not in headers:
            raise InputError(
                text.path,
                key,
                f"the unknown column {header!r}",
                f"--ignore {header!r}, or {suggest_names(header, names)}",
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
            f"{unit}, {largest:.3g} at most; --lengths, --angles and --rotation state"
            " what else it is",
        )


def _read_all_or_none(
    table: PoseTable, cells: Cells, names: tuple[str, ...]
) -> np.ndarray | None:
    """Read columns, ndarray (N, len(names)); None if the table has none of them."""
    present = [name for name in names if name in table.columns]
    missing = [name for name in names if name not in table.columns]
    if not present:
        return None
    if missing:
        text = table.text
        problem = f"{', '.join(present)} without {', '.join(missing)}"
        header = f"line {text.dialect.header}"
        raise InputError(text.path, header, problem, "all of them or none")
    return cells.matrix(names)


def read_target_path_for(
    path: str | Path, robot: Robot, options: TableOptions = _AS_RECOGNIZED
) -> TargetPath:
    """Read a file of target poses for a robot; joint angles in degrees are refused too
    unless they are stated to be so."""
    targets = read_target_path(path, robot.commands, options, robot)
    if targets.start is None:
        return targets
    in_degrees = find_degrees(targets.start, robot)
    if in_degrees.any():
        row, joint = np.argwhere(in_degrees)[0]
        low, high = robot.joint_limits[robot.leading_joints[joint]]
        raise InputError(
            path,
            f"line {targets.lines[row]}",
            f"q{joint + 1} looks like degrees: {targets.start[row, joint]:g}",
            f"rad, of a joint that goes from {low:.2f} to {high:.2f} rad",
        )
    return targets
