"""Read the table of corrected targets, and the table of what a tracker measured there.

The first is written by `elastocal correct`. The second has one row for each
measurement, in the columns of measurements.csv or under the usual names of other
programs: the position, and where there are any the number of the target's row in the
first table (``pose``), the reflector, the repeat, the orientation, time and temperature.
Lengths are metres and angles rad unless the header or an option states another unit.
"""

from __future__ import annotations

from collections import Counter
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
from scipy.spatial.transform import Rotation

from elastocal.campaigns.measurements import ROTATION
from elastocal.campaigns.tables import Dialect, read_text_table
from elastocal.counting import format_count
from elastocal.errors import InputError, suggest_names
from elastocal.exchange.column_names import (
    NO_ROTATION,
    POSITION,
    find_columns,
    find_rotation,
    find_scales,
    find_units,
)
from elastocal.exchange.joining import read_key
from elastocal.exchange.pose_table import (
    PoseTable,
    TableOptions,
    read_cells,
    read_rotation_vectors,
)
from elastocal.exchange.target_path import NO_BOUND, OK
from elastocal.exchange.times import read_times
from elastocal.mechanics.components import WRENCH_NAMES, list_joint_columns

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence

    from elastocal.campaigns.tables import Cells, TextTable
    from elastocal.mechanics.robot import Robot

_ERRORS = (
    "predicted_error_before_m",
    "predicted_error_after_m",
)
_BOUND = "predicted_bound_m"
_POSE = (*POSITION, *ROTATION)
# By how much a measured joint angle may differ from its target, rad or m: what the
# display of a controller rounds off.
_SAME_ANGLE = 1e-4
# Positions in millimetres spread over more than this multiple of the targets' extent and
# of the distance of a reflector from its point, m.
_LARGEST_SPREAD = 10.0
_REFLECTOR_M = 1.0
# Columns of measurements that are joined to a campaign if it has them too.
_CONDITIONS = ("time_s", "temperature_c")


@dataclass(frozen=True)
class CorrectedTargets:
    """The table of `elastocal correct`, N rows.

    Attributes
    ----------
    usable : (N,) bool, rows with joint targets. The others hold NaN.
    joint_angles : (N, n) commands as the controller reports them, rad.
    wrench : (N, 6) loads, N and N m.
    position, rotation : (N, 3), m, and (N, 3, 3) wanted poses, base axes.
    before_m, after_m, bound_m : (N,) predicted errors; the bound is NaN where none was
        stated.
    """

    usable: np.ndarray
    joint_angles: np.ndarray
    wrench: np.ndarray
    position: np.ndarray
    rotation: np.ndarray
    before_m: np.ndarray
    after_m: np.ndarray
    bound_m: np.ndarray

    def __len__(self) -> int:
        return len(self.usable)

    def select(self, rows: np.ndarray) -> CorrectedTargets:
        """Return the targets of some rows (M,), from 0."""
        return CorrectedTargets(
            **{name: values[rows] for name, values in vars(self).items()}
        )


@dataclass(frozen=True)
class TargetMeasurements:
    """M measurements at corrected targets.

    Attributes
    ----------
    row : (M,) int, row in the table of targets, from 0.
    repeat : (M,) int.
    target : (M,) of str, name of the reflector.
    position : (M, 3) m, in the tracker's frame or the base frame.
    rotation_vector : (M, 3) rad; None if no orientations were measured.
    conditions : columns (M,) of time and temperature, by name.
    """

    row: np.ndarray
    repeat: np.ndarray
    target: np.ndarray
    position: np.ndarray
    rotation_vector: np.ndarray | None
    conditions: dict[str, np.ndarray]

    def __len__(self) -> int:
        return len(self.row)

    def select(self, mask: np.ndarray) -> TargetMeasurements:
        """Return the measurements of a mask (M,)."""
        vectors = self.rotation_vector
        return TargetMeasurements(
            self.row[mask],
            self.repeat[mask],
            self.target[mask],
            self.position[mask],
            None if vectors is None else vectors[mask],
            {name: values[mask] for name, values in self.conditions.items()},
        )


def read_corrected_targets(path: str | Path, joints: int) -> CorrectedTargets:
    """Read the joint targets that `elastocal correct` has written.

    Parameters
    ----------
    path : CSV file.
    joints : number of joints of the robot.

    Raises
    ------
    InputError
        If a column is missing, a cell is not a number, or no row has joint targets.
    """
    source = Path(path)
    if not source.is_file():
        allowed = "the table that elastocal correct wrote; --targets FILE names it"
        raise InputError(source, "", "no such file", allowed)
    text = read_text_table(path, lambda _: True, Dialect("comma", "point"))
    angles = list_joint_columns(joints)
    names = [*angles, *_ERRORS, *_POSE, *WRENCH_NAMES]
    missing = [name for name in (*names, _BOUND, "status") if name not in text.columns]
    if missing:
        allowed = "a table that elastocal correct has written for this robot"
        raise InputError(source, "header", f"no column {missing[0]!r}", allowed)
    usable = np.array([is_corrected(status) for status in text.columns["status"]])
    if not usable.any():
        raise InputError(source, "status", "no corrected target", f"rows that are {OK}")
    cells = text.cells({name: name for name in names}, {}, np.flatnonzero(usable))
    values = np.full((len(usable), len(names)), np.nan)
    values[usable] = cells.matrix(names)
    column = {name: values[:, number] for number, name in enumerate(names)}
    rotation = np.full((len(usable), 3, 3), np.nan)
    vectors = np.column_stack([column[name] for name in ROTATION])
    rotation[usable] = Rotation.from_rotvec(vectors[usable]).as_matrix()
    bounds = [float(cell) if cell.strip() else np.nan for cell in text.columns[_BOUND]]
    return CorrectedTargets(
        usable,
        values[:, :joints],
        np.column_stack([column[name] for name in WRENCH_NAMES]),
        np.column_stack([column[name] for name in POSITION]),
        rotation,
        column["predicted_error_before_m"],
        column["predicted_error_after_m"],
        np.where(usable, bounds, np.nan),
    )


def arrange_corrected_targets(table: pd.DataFrame, joints: int) -> CorrectedTargets:
    """Arrange a table of joint targets in memory, as `read_corrected_targets`."""
    usable = table["status"].map(is_corrected).to_numpy(bool)
    rotation = np.full((len(usable), 3, 3), np.nan)
    vectors = table[[*ROTATION]].to_numpy(float)
    rotation[usable] = Rotation.from_rotvec(vectors[usable]).as_matrix()
    angles = list_joint_columns(joints)
    return CorrectedTargets(
        usable,
        table[angles].to_numpy(float),
        table[[*WRENCH_NAMES]].to_numpy(float),
        table[[*POSITION]].to_numpy(float),
        rotation,
        *(table[name].to_numpy(float) for name in (*_ERRORS, _BOUND)),
    )


def arrange_positions(
    targets: CorrectedTargets, position: np.ndarray, reflector: str
) -> TargetMeasurements:
    """Arrange measured positions (N, 3) of one reflector at all N targets, m; NaN where
    it was not measured."""
    row = np.flatnonzero(targets.usable & ~np.isnan(position).any(axis=1))
    names = np.array([reflector] * len(row))
    repeat = np.zeros(len(row), int)
    return TargetMeasurements(row, repeat, names, position[row], None, {})


def is_corrected(status: str) -> bool:
    """Whether a row of this status has joint targets."""
    return status == OK or status.startswith(NO_BOUND.strip())


def read_target_measurements(
    path: str | Path,
    targets: CorrectedTargets,
    robot: Robot,
    reflectors: Collection[str],
    lengths: str = "m",
) -> TargetMeasurements:
    """Read what a tracker measured at corrected targets.

    Parameters
    ----------
    path : table of the measurements.
    targets : the targets. Without a column ``pose`` the measurements of each reflector
        are those of all targets, in their order.
    robot : the robot.
    reflectors : targets of the campaign. The only one may be left out of the table.
    lengths : unit of lengths whose header states none.

    Raises
    ------
    InputError
        If there are no positions, a cell is not a number, or a measurement belongs to no
        target.
    """
    text = read_cells(path, TableOptions())
    columns, stated_units = find_columns(text, {}, robot)
    notation = find_rotation(text, columns, _state_notation(text))
    table = PoseTable(text, columns, stated_units, notation)
    angles = list_joint_columns(robot.commands)
    if not all(name in columns for name in angles):
        angles = []
    wanted = [*POSITION, *table.orientation, *angles]
    usual_units = {"lengths": lengths, "angles": "rad"}
    units = find_units(text, columns, wanted, stated_units, usual_units, robot)
    cells = text.cells(columns, find_scales(units))
    names = _read_reflectors(text, columns, reflectors)
    row = _assign_rows(text, columns, names, targets)
    if angles:
        _refuse_other_angles(cells, angles, targets.joint_angles[row])
    position = cells.matrix(POSITION)
    _refuse_millimetres(cells, position, targets.position[row])
    repeat = _count_repeats(row, names)
    if "repeat" in columns:
        repeat = cells.integers("repeat")
    _refuse_repeated(text, row, names, repeat)
    return TargetMeasurements(
        row,
        repeat,
        names,
        position,
        None if notation == NO_ROTATION else read_rotation_vectors(cells, table),
        _read_conditions(text, columns, stated_units),
    )


def _read_conditions(
    text: TextTable, columns: dict[str, str], stated_units: dict[str, str]
) -> dict[str, np.ndarray]:
    """Read time and temperature. Only further rounds use them, so a column that holds
    something else is left out."""
    conditions = {}
    for name in _CONDITIONS:
        if name not in columns:
            continue
        with suppress(InputError):
            units = find_units(text, columns, [name], stated_units, {})
            cells = text.cells({name: columns[name]}, find_scales(units))
            is_time = name == "time_s"
            conditions[name] = read_times(cells) if is_time else cells.numbers(name)
    return conditions


def _refuse_other_angles(
    cells: Cells, names: Sequence[str], commanded: np.ndarray
) -> None:
    """Refuse joint angles that are not those of the target."""
    wrong = np.abs(cells.matrix(names) - commanded) > _SAME_ANGLE
    cells.refuse(wrong, names, "the joint angle of this target, as corrected")


def are_millimetres(position: np.ndarray, wanted: np.ndarray) -> bool:
    """Whether positions (M, 3) spread so much farther than the wanted ones (M, 3), m, that
    they are not in metres."""
    spread = np.ptp(position, axis=0).max()
    allowed_spread = _LARGEST_SPREAD * (np.ptp(wanted, axis=0).max() + _REFLECTOR_M)
    return bool(spread > allowed_spread)


def _refuse_millimetres(cells: Cells, position: np.ndarray, wanted: np.ndarray) -> None:
    """Refuse positions (M, 3) that are not in metres."""
    if are_millimetres(position, wanted):
        distance = np.abs(position - np.median(position, axis=0))
        allowed = (
            "metres; --lengths mm, or a header such as 'x [mm]', states another unit"
        )
        cells.refuse(distance == distance.max(), POSITION, allowed)


def _state_notation(text: TextTable) -> str | None:
    """Return the notation of orientations in the columns of measurements.csv, which are
    no Euler angles; None if the columns are others."""
    return "vector" if set(ROTATION) <= set(text.columns) else None


def _read_reflectors(
    text: TextTable, columns: dict[str, str], reflectors: Collection[str]
) -> np.ndarray:
    """Read the reflector of each measurement."""
    if "target" not in columns:
        if len(reflectors) > 1:
            names = ", ".join(reflectors)
            finding = "no column 'target'"
            raise InputError(text.path, "header", finding, f"it, with one of: {names}")
        return np.array([*reflectors] * len(text.lines))
    stated = [cell.strip() for cell in text.columns[columns["target"]]]
    for line, name in zip(text.lines, stated, strict=True):
        if name not in reflectors:
            allowed = f"a target of the campaign: {suggest_names(name, [*reflectors])}"
            raise InputError(text.path, f"line {line}", repr(name), allowed)
    return np.array(stated)


def _assign_rows(
    text: TextTable,
    columns: dict[str, str],
    names: np.ndarray,
    targets: CorrectedTargets,
) -> np.ndarray:
    """Assign a row of the targets, from 0, to each measurement."""
    count = len(targets)
    if "pose" in columns:
        cells = text.cells({"pose": columns["pose"]}, {})
        pose = np.array([*map(int, read_key(text, "pose", columns["pose"], []))])
        allowed = f"1 to {count}: the row of the target, without the header"
        cells.refuse((pose < 1) | (pose > count), ["pose"], allowed)
        cells.refuse(~targets.usable[pose - 1], ["pose"], "a target that was corrected")
        return pose - 1
    usable = np.flatnonzero(targets.usable)
    row = np.empty(len(names), int)
    for name, measured in Counter(names.tolist()).items():
        if measured != len(usable):
            finding = (
                f"{format_count(measured, 'measurement')} of {name}"
                " and no column 'pose'"
            )
            allowed = (
                f"{len(usable)}, one for each target in their order, or a column pose"
                " with the number of the target"
            )
            raise InputError(text.path, "header", finding, allowed)
        row[names == name] = usable
    return row


def _count_repeats(row: np.ndarray, names: np.ndarray) -> np.ndarray:
    """Count the measurements of one target and reflector, from 0."""
    measurements = pd.DataFrame({"row": row, "name": names})
    return measurements.groupby(["row", "name"]).cumcount().to_numpy()


def _refuse_repeated(
    text: TextTable, row: np.ndarray, names: np.ndarray, repeat: np.ndarray
) -> None:
    """Refuse a second measurement of the same target, reflector and repeat."""
    earlier: dict[tuple[int, str, int], int] = {}
    keys = zip(row.tolist(), names.tolist(), repeat.tolist(), strict=True)
    for line, key in zip(text.lines, keys, strict=True):
        if key in earlier:
            finding = f"pose {key[0] + 1}, repeat {key[2]} of {key[1]} again"
            allowed = f"each once (first in line {earlier[key]})"
            raise InputError(text.path, f"line {line}", finding, allowed)
        earlier[key] = line
