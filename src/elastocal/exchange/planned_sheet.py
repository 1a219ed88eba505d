"""The sheet of a plan, filled in and saved by a spreadsheet: its columns are those of measurements.csv, in its units."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from elastocal.campaigns.measurements import SHOWN, SHOWN_TO, TICK, file_columns, sheet_columns, shown
from elastocal.errors import InputError
from elastocal.exchange.column_names import LENGTH, POSITION, VECTOR, kind_of
from elastocal.io.texts import plain_number

if TYPE_CHECKING:
    from elastocal.exchange.csv_dialect import TextTable
    from elastocal.exchange.measurement_table import ImportOptions

# A table names no more.
_MOST_JOINTS = 99


def sheet_options(text: TextTable, options: ImportOptions) -> ImportOptions:
    """Options of an import with the units of a sheet of `plan`, where the table is one; stated ones go first.

    An InputError names the row in which ``q1_deg`` is not ``q1``: one of them was edited.
    """
    headers = {header for header in text.columns if header}
    beside = headers & sheet_columns(_MOST_JOINTS) - {TICK}
    names = {header.partition("_")[0]: header for header in beside}
    needed = {TICK, "pose", "load", "repeat", "target", *POSITION, *names}
    if not (names and needed <= headers and headers - beside - {TICK} <= {*file_columns(_MOST_JOINTS)}):
        return options
    units = {}
    for name, header in names.items():
        unit = header.partition("_")[2]
        units[name] = "m" if unit == "mm" else "rad"
        for line, exact, seen in zip(text.lines, text.columns[name], text.columns[header], strict=True):
            value, other = plain_number(exact), plain_number(seen)
            if value is not None and other is not None and abs(value / SHOWN[unit] - other) > SHOWN_TO:
                allowed = f"{value / SHOWN[unit]:.3f}, which is {name}, or a table without the column {header}"
                raise InputError(text.path, f"line {line}, column {header}", shown(seen), allowed)
    given = dict(options.units or {})
    for name in (*POSITION, *VECTOR):
        kind, usual = ("lengths", "m") if kind_of(name)[0] == LENGTH else ("angles", "rad")
        if name in headers and kind not in given:
            units[name] = usual
    return replace(
        options,
        columns={name: name for name in names} | dict(options.columns or {}),
        units=units | given,
        rotation=options.rotation or ("vector" if {*VECTOR} <= headers else None),
    )
