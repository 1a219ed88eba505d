"""Measurements of another program's table, as a campaign has them.

What a name, a unit or a notation leaves open is asked for, never guessed: an angle without unit, ``rx, ry, rz`` that may be a
rotation vector or Euler angles. What was found out is returned as options with which the import can be repeated.
"""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from scipy.spatial import cKDTree

from elastocal.campaigns.column_bounds import FARTHEST_RAD
from elastocal.campaigns.measurements import file_columns
from elastocal.errors import InputError, closest_first, text_fault
from elastocal.exchange.column_meanings import check_complete, find_columns, find_rotation, find_units
from elastocal.exchange.column_names import ANGLE, POSITION, UNITS, VECTOR, find_joints, is_name, read_units, recognize_column
from elastocal.exchange.csv_dialect import read_text_table
from elastocal.exchange.import_options import BY_ROBOT, ImportOptions, sheet_options
from elastocal.exchange.markers import choose_markers, has_position, markers_in, one_row_each
from elastocal.exchange.measurement_cells import CellReader, covariates_of, rows_with_position
from elastocal.exchange.rotations import HOMOGENEOUS_MATRICES, QUATERNIONS, columns_of_rotation, rotation_vectors
from elastocal.mechanics.components import WRENCH_NAMES
from elastocal.mechanics.robot import Robot

# Angles that a controller reports twice at one standstill agree to better; poses of a plan lie degrees apart.
SAME_POSE = 1e-3
_TRANSLATION = ("t14", "t24", "t34")
# Rows of one pose whose joints stand farther apart (rad or m) are not of one pose: a label says something else.
_ONE_POSE = 0.1


@dataclass(frozen=True)
class ImportedMeasurements:
    """Measurements as a campaign has them.

    `table` (N,): columns of measurements.csv. `options`: with which the same comes out again: nothing is left to be found out.
    `ignored`: headers of columns that are not used. `skipped`: rows without a position that were left out. `notes`: how columns
    were understood that may surprise, and what else was left out.
    """

    table: dict[str, np.ndarray]
    joints: int
    options: ImportOptions
    ignored: tuple[str, ...]
    skipped: int
    notes: tuple[str, ...] = ()


def read_measurement_table(path: str | Path, options: ImportOptions, robot: Robot | None = None) -> ImportedMeasurements:
    """Read measurements from a table of another program.

    `robot`: whose joints they are: columns may be called as its file names them, and there have to be as many. Raises
    `InputError`: what is missing or ambiguous, with the option that says it; or line and column of what is no number or no
    rotation.
    """
    mapped = dict(options.columns or {})
    for name in (*mapped, *(set(options.units or {}) - {"angles", "lengths"})):
        if not is_name(name):
            raise InputError("--column", "", repr(name), closest_first(name, [*file_columns(6), "qw", "e1", "r11", "t11"]))

    def is_header(cells: Sequence[str]) -> bool:
        names = {recognize_column(cell)[0] for cell in cells} | {name for name, header in mapped.items() if header in cells}
        return has_position(names) or bool(markers_in(cells))

    text = read_text_table(path, is_header, options, options.ignore or (), units_in=read_units)
    options = sheet_options(text, options)
    mapped, notes = dict(options.columns or {}), [f"units in the row under the header: {len(text.units)}"] if text.units else []
    if targets := choose_markers(text, options.target, options.targets, mapped):
        text, mapped, of_targets = one_row_each(text, targets, mapped)
        options, notes = replace(options, target=None, targets=targets), [*notes, *of_targets]
    columns, stated, counted = find_columns(text, mapped, robot)
    notes += counted
    rotation = find_rotation(text, columns, mapped, options.rotation)
    position = _TRANSLATION if rotation == HOMOGENEOUS_MATRICES else POSITION
    angles = find_joints(columns)
    orientation = columns_of_rotation(rotation, columns)
    check_complete(text, columns, angles, (*position, *orientation), robot)
    wanted = [*angles, *position, *orientation, *(name for name in WRENCH_NAMES if name in columns)]
    units = find_units(text, columns, wanted, stated, options.units or {}, robot)
    read = CellReader(text, columns, units, rows_with_position(text, columns, position, options.skip_empty))
    covariates = covariates_of(read, mapped, stated, options.units or {}, notes)
    notes += _surprises(read, angles, {*stated, *(options.units or {})})
    table = _number_poses(read, angles, mapped)
    table |= {name: read.numbers(name) for name in angles}
    table |= _wrench(read, options.wrench)
    table |= {axis: read.numbers(name) for axis, name in zip(POSITION, position, strict=True)}
    if orientation:
        table |= dict(zip(VECTOR, _vectors(read, rotation, orientation).T, strict=True))
    table |= covariates
    table |= {f"approach{j}": read.numbers(f"approach{j}") for j in range(1, len(angles) + 1) if f"approach{j}" in columns}
    table["target"] = _targets(read, options.target)
    table |= _ordinals(read, table)
    used = {*wanted, *table}
    resolved = replace(
        options,
        **asdict(text.dialect),
        columns={name: header for name, header in columns.items() if name in used and not (name == "target" and targets)},
        units=units,
        rotation=rotation,
    )
    read_headers = {columns[name] for name in columns if name in used}
    ignored = tuple(header for header in text.columns if header not in read_headers)
    skipped = len(text.lines) - len(read.kept)
    return ImportedMeasurements(
        table, len(angles), resolved, (*ignored, *(options.ignore or ())), skipped, (*text.left_out, *notes)
    )


def _surprises(read: CellReader, angles: Sequence[str], stated: set[str]) -> list[str]:
    """Units that nothing states, and angles that may be in another one."""
    usual = [name for name in WRENCH_NAMES if name in read.units and name not in stated]
    named = ", ".join(f"{read.columns[name]!r} in {read.units[name]}" for name in usual)
    notes = [f"units as usual, as nothing states them: {named}"] if usual else []
    for name in angles:
        largest = np.abs(read.numbers(name)).max()
        if read.units[name] in UNITS[ANGLE] and largest > FARTHEST_RAD:
            turns = f"{largest / (2 * np.pi):.1f} turns"
            notes.append(f"{read.columns[name]!r} goes to {largest:.4g} rad, {turns}: if these are degrees, --angles deg")
    return notes


def _wrench(read: CellReader, acts: str) -> dict[str, np.ndarray]:
    there = [name for name in WRENCH_NAMES if name in read.columns]
    if not there:
        return {}
    sign = -1.0 if acts == BY_ROBOT else 1.0
    zeros = np.zeros(len(read.kept))
    # A minus sign before a zero would be read by people as a force.
    return {name: (sign * read.numbers(name) + 0.0 if name in there else zeros) for name in WRENCH_NAMES}


def _vectors(read: CellReader, rotation: str, names: Sequence[str]) -> np.ndarray:
    values = np.column_stack([read.numbers(name) for name in names])
    vectors, off = rotation_vectors(rotation, values)
    if off.any():
        allowed = "a quaternion of length 1" if rotation == QUATERNIONS else "a rotation matrix, row by row"
        raise read.fault(int(np.argmax(off)), names[0], allowed)
    return vectors


def _targets(read: CellReader, name: str | None) -> np.ndarray:
    if "target" in read.columns:
        names = read.cells("target")
        if fault := next((fault for each in set(names) if (fault := text_fault(each))), None):
            raise InputError(read.text.path, f"column {read.columns['target']}", *fault)
        return np.array(names)
    if name is None:
        allowed = "--target NAME, the target of all rows, or --column target=NAME"
        raise InputError(read.text.path, "header", "no column target", allowed)
    if fault := text_fault(name):
        raise InputError("--target", "", *fault)
    return np.full(len(read.kept), name)


def _number_poses(read: CellReader, angles: Sequence[str], mapped: Mapping[str, str]) -> dict[str, np.ndarray]:
    """Session and pose: labels are numbered; where no column has it, a pose is what has the same joint angles."""
    table: dict[str, Any] = {}
    if "session" in read.columns:
        table["session"] = read.integers("session")
    if "pose" in read.columns:
        labels = read.cells("pose")
        numbered = all(label.isdigit() for label in labels)
        table["pose"] = read.integers("pose") if numbered else pd.factorize(pd.Series(labels))[0] + 1
        if "pose" not in mapped and "session" not in table:
            _check_poses(read, angles, table["pose"])
    else:
        table["pose"] = _number_alike(np.column_stack([read.numbers(name) for name in angles]), SAME_POSE)
    return table


def _check_poses(read: CellReader, angles: Sequence[str], pose: np.ndarray) -> None:
    """Ask what a column is whose name says pose, but not its contents, such as the configuration of an arm: FUT."""
    values = pd.DataFrame({name: read.numbers(name) for name in angles}).groupby(pose)
    apart = (values.transform("max") - values.transform("min")).max(axis=1).to_numpy() > _ONE_POSE
    if apart.any():
        header = read.columns["pose"]
        allowed = f"one posture for each, or --ignore {header!r}, or --column pose=NAME (NAME {header!r} where it is right)"
        raise read.fault(int(np.argmax(apart)), "pose", allowed)


def _ordinals(read: CellReader, table: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Loads and repeats: as their columns have them, or counted by first appearance."""
    states = pd.DataFrame({"session": table.get("session", 0), "pose": table["pose"], "target": table["target"]})
    wrench = pd.DataFrame({name: table.get(name, 0.0) for name in WRENCH_NAMES}, index=states.index)
    if "load" in read.columns:
        states["load"] = read.integers("load")
    else:
        loads = pd.concat([states[["session", "pose"]], wrench], axis=1)
        different = loads[wrench.any(axis=1)].drop_duplicates()
        different["load"] = different.groupby(["session", "pose"]).cumcount() + 1
        states["load"] = loads.merge(different, how="left")["load"].fillna(0).astype(np.int64)
    if "repeat" in read.columns:
        states["repeat"] = read.integers("repeat")
    else:
        states["repeat"] = states.groupby(["session", "pose", "load", "target"]).cumcount()
    return {name: states[name].to_numpy() for name in ("load", "repeat")}


def _number_alike(values: np.ndarray, within: float) -> np.ndarray:
    """Number of each row by first appearance, from 1: one for rows that agree to `within`."""
    different, which = np.unique(values, axis=0, return_inverse=True)
    near = cKDTree(different)
    numbers = np.zeros(len(different), np.int64)
    number = 0
    for row in which:
        if not numbers[row]:
            number += 1
            alike = np.array(near.query_ball_point(different[row], within, p=np.inf))
            numbers[alike[numbers[alike] == 0]] = number
    return numbers[which]
