"""A Denavit-Hartenberg table, as CSV or YAML, checked cell by cell.

One row for each joint, or for what is fixed before, between or behind joints::

    joint, theta_offset_deg, d_m,    a_m,     alpha_deg, type
    1,     0,                0.1625, 0,       90,        R
    2,     0,                0,      -0.425,  0,         R
    3,     0,                0,      -0.3922, 0,         R
    4,     0,                0.1333, 0,       90,        R
    5,     0,                0.0997, 0,       -90,       R
    6,     0,                0.0996, 0,       0,         R

is a UR5e in the standard notation. ``type`` is R (revolute, also where the column is left out), P (prismatic) or F (fixed). A
column of angles or lengths ends in ``_deg``, ``_rad``, ``_m`` or ``_mm``, has ``[mm]`` behind its name or a row of units under
the header; without, an option says which. In radians ``pi/2`` may stand for a number. Optional columns: ``lower`` and ``upper``
(joint limits; of prismatic joints lengths), ``compliance_urad_per_Nm``, ``mass_kg`` with ``cx``, ``cy``, ``cz`` (centre of mass
in the frame of the row), and ``point`` (name of a measuring point at the frame of the row). In YAML the table is a list of rows
with the same keys.
"""

import math
import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from elastocal.counting import counted
from elastocal.errors import InputError, closest_first
from elastocal.exchange.column_names import read_units, split_unit
from elastocal.exchange.csv_dialect import Dialect, read_text_table
from elastocal.io.documents import read_document
from elastocal.io.texts import A_NUMBER, LARGEST_NUMBER, plain_number

_ANGLE_UNITS = {"deg": math.radians(1.0), "rad": 1.0}
_LENGTH_UNITS = {"m": 1.0, "mm": 1e-3}
_SIGNS = {"°": "deg"}
REVOLUTE, PRISMATIC, FIXED = "R", "P", "F"
_ANGLES, _LENGTHS, _LIMITS = ("theta_offset", "alpha"), ("d", "a", "cx", "cy", "cz"), ("lower", "upper")
_PLAIN = ("compliance_urad_per_Nm", "mass_kg")
_WORDS = ("joint", "type", "point")
_NEEDED = ("d", "a", "alpha")
# By which the unit is stated of what turns, and of what does not.
_OPTIONS = {True: "--angles deg or rad", False: "--lengths m or mm"}
_PI = re.compile(r"([+-]?)(\d+(?:\.\d+)?)?\*?pi(?:/(\d+(?:\.\d+)?))?", re.ASCII | re.IGNORECASE)
# The chain of more has no room in a robot file.
MOST_ROWS = 500
# A joint may count any number of turns; a thousand are a mistake.
MOST_TURNS = 1000


@dataclass(frozen=True)
class DhRow:
    """One row, in SI units.

    `where`: line or row of the file, for messages. `joint`: as the table calls it; empty where it does not. `kind`: one of "R",
    "P", "F". `theta`, `d`, `a`, `alpha`: rad and m; theta of a revolute joint is the offset that is added to its angle, d of a
    prismatic one to its shift. `limits` (float, float): rad, of a prismatic joint m. `compliance`: µrad/(N m), of a prismatic
    joint µm/N. `centre_m` (float, float, float): in the frame of the row. `point`: measuring point at the frame of the row;
    empty for none.
    """

    where: str
    joint: str
    kind: str
    theta: float
    d: float
    a: float
    alpha: float
    limits: tuple[float, float] | None
    compliance: float | None
    mass_kg: float | None
    centre_m: tuple[float, float, float]
    point: str


@dataclass(frozen=True)
class DhOptions:
    """How a table is read.

    `angles`, `lengths`: units of columns that do not say; asked for where they are None. `decimal`: of CSV; commas are asked
    for where it is not stated. `ignore`: columns that are left out.
    """

    angles: str | None = None
    lengths: str | None = None
    decimal: str | None = None
    ignore: Collection[str] = ()


AS_STATED = DhOptions()


def read_dh_table(path: str | Path, options: DhOptions = AS_STATED) -> tuple[list[DhRow], list[str]]:
    """Rows of a Denavit-Hartenberg table, and notes how they were understood and what was left out.

    `path`: ends in ``.csv``, ``.yaml`` or ``.yml``. Raises `InputError`: file, line and column of what cannot be read, or a
    column whose unit nothing states.
    """
    source = Path(path).as_posix()
    suffix = Path(path).suffix.lower()
    if suffix not in (".csv", ".yaml", ".yml"):
        raise InputError(source, "", f"a file that ends in {suffix or 'nothing'!r}", ".csv, .yaml or .yml")
    columns, table, left_out = (_csv_rows if suffix == ".csv" else _yaml_rows)(path, source, options)
    meanings = _meanings(columns, options, source)
    if len(table) > MOST_ROWS:
        raise InputError(source, "", counted(len(table), "row"), f"at most {MOST_ROWS}, one for each joint")
    rows = [_row(where, cells, meanings, source) for where, cells in table]
    if not any(row.kind != FIXED for row in rows):
        raise InputError(source, "", "no joint", "a row of type R or P for each joint")
    return rows, [f"read: {'; '.join(f'{name!r} as {meaning}' for name, meaning in meanings.items())}", *left_out]


@dataclass(frozen=True)
class _Meaning:
    """What a column holds: its name without the unit, and the units that its angles and its lengths have, if any."""

    name: str
    angle: str = ""
    length: str = ""

    def __str__(self) -> str:
        units = " or ".join(unit for unit in (self.angle, self.length) if unit)
        return f"{self.name} in {units}" if units else self.name


_Rows = tuple[dict[str, str], list[tuple[str, dict[str, Any]]], list[str]]


def _csv_rows(path: str | Path, source: str, options: DhOptions) -> _Rows:
    """Columns with the units that a row under them has, rows by where they stand, and what was left out."""
    wanted = "columns d, a and alpha, such as d_m or d_mm"
    text = read_text_table(path, _has_known_column, Dialect(decimal=options.decimal), options.ignore, wanted, read_units)
    if text.dialect.decimal == "comma" and options.decimal is None:
        raise InputError(source, "", "numbers with commas", "--decimal comma where the comma is the decimal mark, else points")
    rows = zip(*text.columns.values(), strict=True)
    table = [(f"line {line}", dict(zip(text.columns, row, strict=True))) for line, row in zip(text.lines, rows, strict=True)]
    file = f"names of columns in line {text.dialect.header}, separator {text.dialect.separator}, decimal {text.dialect.decimal}"
    unused = [f"not used: {', '.join(options.ignore)}"] if options.ignore else []
    columns = {name: text.units.get(name, "") for name in text.columns}
    return columns, table, [f"file: {file}, encoding {text.dialect.encoding}", *unused, *text.left_out]


def _has_known_column(cells: Sequence[str]) -> bool:
    return any(split_unit(cell)[0] in _NEEDED for cell in cells)


def _yaml_rows(path: str | Path, source: str, options: DhOptions) -> _Rows:
    rows = read_document(path)
    if not isinstance(rows, list) or not rows or not all(isinstance(row, dict) for row in rows):
        raise InputError(source, "", type(rows).__name__, "a list of rows, such as `- {d_m: 0.1, a_m: 0, alpha_deg: 90}`")
    names = list(dict.fromkeys(str(name) for row in rows for name in row))
    for name in options.ignore:
        if name not in names:
            raise InputError(source, "", f"no key {name!r} to ignore", closest_first(name, names))
    columns = dict.fromkeys((name for name in names if name not in options.ignore), "")
    table = [(f"row {number}", {str(name): cell for name, cell in row.items()}) for number, row in enumerate(rows, 1)]
    return columns, table, [f"not used: {', '.join(options.ignore)}"] if options.ignore else []


def _meanings(columns: Mapping[str, str], options: DhOptions, source: str) -> dict[str, _Meaning]:
    """What each column is, by its name and the unit of the row under it."""
    found: dict[str, _Meaning] = {}
    for column, below in columns.items():
        meaning = _find_meaning(column, below, options, source)
        if any(meaning.name == other.name for other in found.values()):
            raise InputError(source, "header", f"{meaning.name} twice", "each column once")
        found[column] = meaning
    for name in _NEEDED:
        if not any(meaning.name == name for meaning in found.values()):
            raise InputError(source, "header", f"no column {name}", "theta_offset, d, a and alpha, such as d_m or d_mm")
    return found


def _find_meaning(column: str, below: str, options: DhOptions, source: str) -> _Meaning:
    if column in (*_PLAIN, *_WORDS):
        return _Meaning(column)
    name, stated = split_unit(column)
    stated, beneath = (_SIGNS.get(unit or "", unit or "") for unit in (stated, below))
    unit = stated or beneath
    if stated and beneath and stated != beneath:
        raise InputError(source, "header", f"{column!r} and {below!r} in the row under it", "one unit")
    turns, shifts = name in (*_ANGLES, *_LIMITS), name in (*_LENGTHS, *_LIMITS)
    if not (turns or shifts):
        names = ["joint", "theta_offset_deg", "d_m", "a_m", "alpha_deg", "type", "lower_deg", "upper_deg", *_PLAIN]
        allowed = closest_first(column, [*names, "cx_m", "cy_m", "cz_m", "point"])
        raise InputError(source, "header", repr(column), f"{allowed}; import dh --ignore {column!r} leaves it out")
    units = [*(_ANGLE_UNITS if turns else ()), *(_LENGTH_UNITS if shifts else ())]
    if unit and unit not in units:
        raise InputError(source, "header", f"{column!r} in {unit}", ", ".join(units))
    angle = unit if unit in _ANGLE_UNITS else options.angles
    length = unit if unit in _LENGTH_UNITS else options.lengths
    meaning = _Meaning(name, (turns and angle) or "", (shifts and length) or "")
    if not (meaning.angle or meaning.length):
        allowed = f"{_OPTIONS[turns]}, or {name}_{'deg' if turns else 'mm'} and such"
        raise InputError(source, "header", f"no unit of {column!r}", allowed)
    return meaning


def _row(where: str, cells: Mapping[str, Any], meanings: Mapping[str, _Meaning], source: str) -> DhRow:
    column_of = {meaning.name: column for column, meaning in meanings.items()}

    def text(name: str) -> str:
        cell = cells.get(column_of.get(name, ""))
        return "" if cell is None else str(cell).strip()

    kind = (text("type") or REVOLUTE).upper()[:1]
    if kind not in (REVOLUTE, PRISMATIC, FIXED):
        raise InputError(source, f"{where}, type", repr(text("type")), "R (revolute), P (prismatic) or F (fixed)")

    def number(name: str) -> float | None:
        """In SI units; None where nothing stands."""
        if not text(name):
            return None
        column, meaning = column_of[name], meanings[column_of[name]]
        turns = name in _ANGLES or (name in _LIMITS and kind != PRISMATIC)
        if name not in _PLAIN and not (meaning.angle if turns else meaning.length):
            found = f"a limit without a unit of {'angles' if turns else 'lengths'}"
            raise InputError(source, f"{where}, {column}", found, _OPTIONS[turns])
        value = _number(text(name), turns and meaning.angle == "rad")
        largest = MOST_TURNS * (2.0 * math.pi if meaning.angle == "rad" else 360.0) if turns else LARGEST_NUMBER
        if value is None or abs(value) > largest:
            allowed = f"a number, {MOST_TURNS} turns at most" if turns else A_NUMBER
            raise InputError(source, f"{where}, {column}", repr(text(name)), allowed)
        if name in _PLAIN:
            if not value > 0:
                raise InputError(source, f"{where}, {column}", text(name), "more than 0")
            return value
        return value * (_ANGLE_UNITS[meaning.angle] if turns else _LENGTH_UNITS[meaning.length])

    for name in _NEEDED:
        if not text(name):
            raise InputError(source, f"{where}, {column_of[name]}", "nothing", "a number")
    low, high = number("lower"), number("upper")
    if (low is None) != (high is None) or (low is not None and high is not None and low >= high):
        raise InputError(source, f"{where}, lower and upper", f"{text('lower') or 'nothing'} to {text('upper') or 'nothing'}",
                         "both limits, the lower one first, or none")  # fmt: skip
    mass, centre = number("mass_kg"), [number(name) for name in ("cx", "cy", "cz")]
    if mass is None and any(part is not None for part in centre):
        raise InputError(source, f"{where}, mass_kg", "nothing, but a centre", "the mass in kg")
    if mass is not None and None in centre:
        raise InputError(source, f"{where}, cx, cy, cz", "no centre of the mass", "three numbers, in the frame of the row")
    x, y, z = (part or 0.0 for part in centre)
    theta, d, a, alpha = (number(name) or 0.0 for name in ("theta_offset", "d", "a", "alpha"))
    limits, compliance = None if low is None or high is None else (low, high), number("compliance_urad_per_Nm")
    return DhRow(where, text("joint"), kind, theta, d, a, alpha, limits, compliance, mass, (x, y, z), text("point"))


def _number(text: str, of_pi: bool) -> float | None:
    """A number, or in radians a multiple of pi; None for anything else."""
    match = _PI.fullmatch(text.replace(" ", "")) if of_pi else None
    if match:
        sign, *parts = match.groups()
        factor, divisor = (plain_number(part or "1") for part in parts)
        return (-1.0 if sign == "-" else 1.0) * factor * math.pi / divisor if factor is not None and divisor else None
    return plain_number(text)
