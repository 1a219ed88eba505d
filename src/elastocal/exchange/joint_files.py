"""Joint angles that lie in a file of their own: a table, or what MoveIt saves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from elastocal.campaigns.tables import read_text_table
from elastocal.errors import InputError
from elastocal.exchange.column_names import (
    find_columns,
    find_joints,
    find_scales,
    find_units,
    read_units,
    recognize_column,
)
from elastocal.io.documents import read_document
from elastocal.mechanics.components import list_joint_columns
from elastocal.mechanics.robot import Robot

_YAML = (".yaml", ".yml")
# Column of a table that says to which image a row belongs.
IMAGE = "image"


@dataclass(frozen=True)
class JointAngles:
    """Joint angles of N samples.

    Attributes
    ----------
    angles : (N, n) array, rad.
    images : name of the image of each row; empty if the file has none.
    """

    angles: np.ndarray
    images: tuple[str, ...] = ()


_HEADER = "a header with q1, q2 and so on, or the names of the robot's joints"


def read_joint_angles(
    path: str | Path, robot: Robot, unit: str | None = None
) -> JointAngles:
    """Read the joint angles of all samples.

    Parameters
    ----------
    path : table, or MoveIt's file of joint states (.yaml).
    robot : robot whose joints columns may be named after.
    unit : "deg" or "rad", of columns that state none.

    Raises
    ------
    InputError
        If a joint is missing or its unit is not stated.
    """
    if Path(path).suffix.lower() in _YAML:
        return JointAngles(_read_joint_states(read_document(path), path, robot))

    def is_header(cells: Sequence[str]) -> bool:
        names = {recognize_column(cell)[0] for cell in cells} - {None}
        is_named = not {*cells}.isdisjoint(robot.command_names or ())
        return is_named or bool(find_joints(name for name in names if name))

    text = read_text_table(path, is_header, wanted=_HEADER, units_in=read_units)
    wanted = list_joint_columns(robot.commands)
    # The sheet of a plan has each angle twice: in degrees for people, and in rad.
    is_sheet = {*wanted, f"{wanted[0]}_deg"} <= {*text.columns}
    named = {name: name for name in wanted} if is_sheet else {}
    columns, stated_units = find_columns(text, named, robot)
    missing = [name for name in wanted if name not in columns]
    if missing:
        problem = f"no column {missing[0]!r}"
        if robot.command_names:
            problem += f" or {robot.command_names[wanted.index(missing[0])]!r}"
        raise InputError(path, "header", problem, _HEADER)
    unit = "rad" if is_sheet else unit
    options = {"angles": unit} if unit else {}
    units = find_units(text, columns, wanted, stated_units, options, robot)
    angles = text.cells(columns, find_scales(units)).matrix(wanted)
    if IMAGE not in text.columns:
        return JointAngles(angles)
    images = text.cells({IMAGE: IMAGE}, {}).texts(IMAGE)
    _refuse_repeated_images(path, images, text.lines)
    return JointAngles(angles, tuple(images))


def _refuse_repeated_images(
    path: str | Path, images: Sequence[str], lines: Sequence[int]
) -> None:
    """Refuse a table in which two lines have joint angles of the same image."""
    line_of_image: dict[str, int] = {}
    for image, line in zip(images, lines, strict=True):
        if image in line_of_image:
            problem = f"{image} in line {line_of_image[image]} too"
            allowed = "one line for each image"
            raise InputError(path, f"line {line}, column {IMAGE}", problem, allowed)
        line_of_image[image] = line


def _read_joint_states(document: Any, path: str | Path, robot: Robot) -> np.ndarray:
    """Read the joint states that MoveIt's hand-eye calibration saves; they are in rad
    and have the names of the joints."""
    allowed = f"joint_names, and joint_values with {robot.commands} numbers in rad each"
    try:
        values = np.asarray(document["joint_values"], float)
        names = [*document["joint_names"]]
    except (KeyError, TypeError, ValueError):
        raise InputError(path, "", "no joint states of MoveIt", allowed) from None
    if values.ndim != 2 or values.shape[1] != len(names):
        raise InputError(path, "joint_values", f"an array {values.shape}", allowed)
    order = [*(robot.command_names or ())]
    if set(order) <= set(names) and order:
        return values[:, [names.index(name) for name in order]]
    if len(names) != robot.commands:
        raise InputError(path, "joint_names", f"{len(names)} joints", allowed)
    return values
