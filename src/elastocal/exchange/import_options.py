"""The options of an import: as a file, with which it can be repeated, and those that a saved sheet of a plan needs."""

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import Any

import yaml

from elastocal.campaigns.measurements import SHOWN, SHOWN_TO, TICK, file_columns, sheet_columns, show_cell
from elastocal.errors import InputError
from elastocal.exchange.column_names import LENGTH, POSITION, VECTOR, kind_of
from elastocal.exchange.csv_dialect import Dialect, TextTable
from elastocal.io.documents import check_document, read_document
from elastocal.io.texts import plain_number

IMPORT, _ON_ROBOT, BY_ROBOT = "import.yaml", "on-robot", "by-robot"
# A table names no more.
_MOST_JOINTS = 99


@dataclass(frozen=True)
class ImportOptions(Dialect):
    """How a table is read; what is None or absent is found out, or refused where it is ambiguous.

    `ignore`: headers of columns that are left out. `columns`: headers by the names of `column_names`. `units`: units by the
    same names; ``angles`` and ``lengths`` for all that have no other. `rotation`: notation of `rotations`. `target`: name for
    all rows where no column has it. `targets`: markers of rows that hold several, by the names of the targets that they are;
    see `markers`. `wrench`: what the forces act on; those that the robot exerts are turned round. `skip_empty`: whether rows
    without a position are left out.
    """

    columns: Mapping[str, str] | None = None
    units: Mapping[str, str] | None = None
    rotation: str | None = None
    target: str | None = None
    wrench: str = _ON_ROBOT
    skip_empty: bool = False
    ignore: Sequence[str] | None = None
    targets: Mapping[str, str] | None = None


def read_import_options(path: str | Path) -> ImportOptions:
    """Options of an earlier import; an InputError names an unknown key or a value that none may have."""
    document = read_document(path) or {}
    check_document(document, "measurement_import", Path(path).as_posix())
    known = {field.name for field in fields(ImportOptions)}
    return ImportOptions(**{key: value for key, value in document.items() if key in known})


def import_options_text(options: ImportOptions, source: str | Path) -> str:
    """Text of the options with which a table, `source`, was imported."""
    digest = hashlib.sha256(Path(source).read_bytes()).hexdigest()
    document: dict[str, Any] = {"source": Path(source).name, "sha256": digest}
    document |= {key: value for key, value in asdict(options).items() if value is not None}
    body = yaml.safe_dump(document, sort_keys=False, allow_unicode=True, default_flow_style=None, width=120)
    return f"# The import again: elastocal import csv FILE --options {IMPORT} --folder FOLDER\n{body}"


def sheet_options(text: TextTable, options: ImportOptions) -> ImportOptions:
    """Options of an import with the units of a sheet of `plan` that a spreadsheet saved, where the table is one.

    Its columns are those of measurements.csv, in its units; stated ones go first. An InputError names the row in which
    ``q1_deg`` is not ``q1``: one of them was edited.
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
                raise InputError(text.path, f"line {line}, column {header}", show_cell(seen), allowed)
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
