"""Tables of joint angles and poses of other programs: measurements, and wanted poses.

The user is asked for what names, units and notations leave open, such as the unit of an
angle, or whether ``rx, ry, rz`` is a rotation vector or Euler angles; nothing is guessed.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from elastocal.campaigns.measurements import describe_columns
from elastocal.campaigns.tables import Cells, Dialect, TextTable, read_text_table
from elastocal.errors import InputError, suggest_names
from elastocal.exchange.column_names import (
    HOMOGENEOUS_MATRICES,
    POSITION,
    QUATERNIONS,
    TRANSLATION,
    convert_to_rotation_vectors,
    find_joints,
    has_position,
    is_name,
    list_rotation_columns,
    read_units,
    recognize_column,
)
from elastocal.io.texts import parse_number
from elastocal.mechanics.components import WRENCH_NAMES


@dataclass(frozen=True)
class TableOptions(Dialect):
    """How a table is read; what is None or absent is recognized, or refused if it is
    ambiguous.

    Attributes
    ----------
    columns : headers by the names of `column_names`.
    units : units by the same names; ``angles`` and ``lengths`` for all columns that
        have no other unit.
    rotation : notation of the orientations, see `find_rotation`.
    ignore : headers of columns that are left out.
    names : names of the columns of a table without a header, in their order.
    """

    columns: Mapping[str, str] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)
    rotation: str | None = None
    ignore: Sequence[str] = ()
    names: Sequence[str] = ()


@dataclass(frozen=True)
class PoseTable:
    """How the columns of a table are understood.

    Attributes
    ----------
    text : the table, one row a target.
    columns : headers by name.
    stated_units : units that headers state, by name.
    rotation : notation of the orientations.
    """

    text: TextTable
    columns: dict[str, str]
    stated_units: dict[str, str]
    rotation: str

    @property
    def angles(self) -> list[str]:
        return find_joints(self.columns)

    @property
    def position(self) -> tuple[str, ...]:
        return TRANSLATION if self.rotation == HOMOGENEOUS_MATRICES else POSITION

    @property
    def orientation(self) -> Sequence[str]:
        return list_rotation_columns(self.rotation, self.columns)

    @property
    def wrench(self) -> list[str]:
        return [name for name in WRENCH_NAMES if name in self.columns]

    @property
    def with_units(self) -> list[str]:
        """Names of all columns that must have a unit."""
        return [*self.angles, *self.position, *self.orientation, *self.wrench]


def check_option_names(options: TableOptions) -> None:
    """Refuse options for columns that cannot be read."""
    names = [*options.columns, *(set(options.units) - {"angles", "lengths"})]
    for name in names:
        if not is_name(name):
            examples = [*describe_columns(6), "qw", "e1", "r11", "t11"]
            raise InputError("--column", "", repr(name), suggest_names(name, examples))


def read_cells(
    path: str | Path, options: TableOptions, headers: Collection[str] = ()
) -> TextTable:
    """Read the cells of a table, below the first line that looks like a header.

    A line with all of these `headers`, if any are given, is one.
    """

    def is_header(cells: Sequence[str]) -> bool:
        if headers and {*headers} <= {*cells}:
            return True
        names = {recognize_column(cell)[0] for cell in cells}
        names |= {name for name, header in options.columns.items() if header in cells}
        if has_position(names):
            return True
        # Joint angles without a position are a header too, so that the error can say
        # what the table lacks.
        has_joints = bool(find_joints(name for name in names if name))
        has_numbers = any(parse_number(cell) is not None for cell in cells)
        return has_joints and len(cells) > 1 and not has_numbers

    return read_text_table(
        path,
        is_header,
        options,
        options.ignore,
        units_in=read_units,
        names=options.names,
    )


def read_rotation_vectors(cells: Cells, table: PoseTable) -> np.ndarray:
    """Read the orientations as rotation vectors, ndarray (N, 3), rad."""
    values = cells.matrix(table.orientation)
    vectors, is_wrong = convert_to_rotation_vectors(table.rotation, values)
    if is_wrong.any():
        allowed = "a rotation matrix, row by row"
        if table.rotation == QUATERNIONS:
            allowed = "a quaternion of length 1"
        raise cells.fault(int(np.argmax(is_wrong)), table.orientation[0], allowed)
    return vectors
