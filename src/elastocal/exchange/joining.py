"""Join a table of positions to the joint angles that are in another file: the sheet of
a plan, or the log of a controller.

Rows belong together by the columns that both files have, by time, or by their order. An
order is no evidence, so the user is shown the pairs and has to state it.
"""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from elastocal.campaigns.tables import TextTable
from elastocal.counting import format_count
from elastocal.errors import InputError, suggest_names
from elastocal.exchange.column_names import find_scales, recognize_column
from elastocal.exchange.times import read_times
from elastocal.io.texts import parse_number

# What identifies a row of a sheet.
KEYS = ("pose", "load", "repeat", "target")
# Values of the option --join beside names of columns.
BY_ORDER = "order"
BY_TIME = "time"
_INTEGER = re.compile(r"\D*(\d{1,9})\D*", re.ASCII)


@dataclass(frozen=True)
class Joined:
    """A table of positions with the joint angles of another file.

    Attributes
    ----------
    text : the table, one row a position.
    columns : headers by name of what the other file has stated by its own names.
    notes : how the rows were joined.
    """

    text: TextTable
    columns: dict[str, str]
    notes: list[str]


@dataclass(frozen=True)
class _Rows:
    """Rows of a file with what identifies them.

    Attributes
    ----------
    path : the file.
    lines : line of each row.
    keys : values of the columns `names` in each row.
    names : names of the columns.
    """

    path: str
    lines: Sequence[int]
    keys: Sequence[tuple[str, ...]]
    names: Sequence[str]

    def describe(self, row: int) -> str:
        """Name a row by its values."""
        pairs = zip(self.names, self.keys[row], strict=True)
        return ", ".join(f"{name} {value}" for name, value in pairs)

    def group(self) -> dict[tuple[str, ...], list[int]]:
        """Group the rows by their values."""
        groups = defaultdict(list)
        for row, key in enumerate(self.keys):
            groups[key].append(row)
        return groups


def join_to_sheet(
    points: TextTable,
    sheet: TextTable,
    columns: Mapping[str, str],
    target: str | None,
    method: str | None,
    *,
    skip_empty: bool,
) -> Joined:
    """Join measured positions to the rows of a planned sheet.

    Parameters
    ----------
    points : table of positions.
    sheet : table with the columns of measurements.csv.
    columns : headers of `points` by name.
    target : name of the target if no column has it.
    method : `BY_ORDER` if the user states it.
    skip_empty : whether rows of the sheet without a position are left out.

    Raises
    ------
    InputError
        A row of either table has no partner or several.
    """
    if method not in (None, BY_ORDER):
        raise InputError("--join", "", repr(method), f"{BY_ORDER}, of a planned sheet")
    notes: list[str] = []
    values = _read_keys(points, columns, notes)
    if target is not None and "target" not in values:
        values["target"] = [target] * len(points.lines)
    sheet_values = _read_keys(sheet, {name: name for name in KEYS}, [])
    measured = _collect_rows(points, values, list(values))
    planned = _collect_rows(sheet, sheet_values, list(values))
    groups = planned.group()
    several = {key for key, rows in groups.items() if len(rows) > 1}
    _refuse_doubled(measured, several)
    pairs = _pair_rows(measured, groups, planned.path)
    shown = _show_pairs(measured, _collect_rows(sheet, sheet_values, KEYS), pairs)
    if several.isdisjoint(measured.keys):
        notes.append(f"rows joined to the sheet by {', '.join(values)}: {shown}")
    elif method == BY_ORDER:
        notes.append(f"rows in the order of the sheet: {shown}")
    else:
        raise _unstated_order_error(measured, planned, shown)
    _refuse_missing(planned, pairs, points.path, skip_empty=skip_empty)
    used = [name for name in sheet.columns if name in KEYS or _is_state(name)]
    dropped = [columns[name] for name in KEYS if name in columns]
    text = _append_columns(points, sheet, used, dropped, pairs)
    return Joined(text, {name: name for name in used}, notes)


def _read_keys(
    text: TextTable, columns: Mapping[str, str], notes: list[str]
) -> dict[str, list[str]]:
    """Read those of the `KEYS` that a table has, by name; `columns`: its headers."""
    names = [name for name in KEYS if name in columns]
    return {name: read_key(text, name, columns[name], notes) for name in names}


def _unstated_order_error(measured: _Rows, planned: _Rows, shown: str) -> InputError:
    """Make the error of rows that only their order can join; `shown` are pairs."""
    missing = [name for name in KEYS if name not in measured.names]
    return InputError(
        measured.path,
        "header",
        f"no column {', '.join(missing)}",
        f"such columns, or --join {BY_ORDER} if the rows are in the order of"
        f" {planned.path}: {shown}",
    )


def _is_state(name: str) -> bool:
    """Whether a column of a sheet states what the robot does: joint angles in rad, loads
    and directions of approach."""
    return re.fullmatch(r"(q|approach)[0-9]+|[fm][xyz]|session", name) is not None


def join_files(
    points: TextTable, joints: TextTable, method: str | None, *, skip_empty: bool
) -> Joined:
    """Join measured positions to the joint angles of another file.

    Parameters
    ----------
    points, joints : tables of positions and of joint angles.
    method : `BY_ORDER`, `BY_TIME` or a column of both files; None takes the only column
        that both have.
    skip_empty : whether joint angles without a position are left out.

    Raises
    ------
    InputError
        A row of either table has no partner or several, or how to join them is
        ambiguous.
    """
    point_headers = _name_headers(points)
    joint_headers = _name_headers(joints)
    common = [name for name in point_headers if name in joint_headers]
    if method == BY_TIME:
        pairs = _pair_by_time(points, joints)
        note = f"rows joined to {joints.path} by time"
        return Joined(
            _append_columns(points, joints, joints.columns, [], pairs), {}, [note]
        )
    names = []
    if method != BY_ORDER:
        names = [_choose_column(points, joints, common, method)]
    point_values = {name: _read_label(points, point_headers[name]) for name in names}
    joint_values = {name: _read_label(joints, joint_headers[name]) for name in names}
    measured = _collect_rows(points, point_values, names)
    driven = _collect_rows(joints, joint_values, names)
    groups = driven.group()
    if names:
        _refuse_doubled(driven)
        if "target" not in point_headers:
            _refuse_doubled(measured)
    pairs = _pair_rows(measured, groups, driven.path)
    _refuse_missing(driven, pairs, points.path, skip_empty=skip_empty)
    how = "in their order"
    if names:
        how = f"by {', '.join(repr(joint_headers[name]) for name in names)}"
    text = _append_columns(points, joints, joints.columns, [], pairs)
    return Joined(text, {}, [f"rows joined to {joints.path} {how}"])


def _name_headers(text: TextTable) -> dict[str, str]:
    """Return the headers of a table that may say which rows belong together, by the name
    that is recognized or in small letters."""
    headers = {}
    for header in text.columns:
        name = recognize_column(header)[0]
        if name is None or name in (*KEYS, "session"):
            headers[name or header.lower()] = header
    return headers


def _choose_column(
    points: TextTable, joints: TextTable, common: Sequence[str], method: str | None
) -> str:
    """Choose the column that both files have: the stated one, or the only one."""
    if method is not None:
        name = recognize_column(method)[0] or method.lower()
        if name in common:
            return name
        allowed = suggest_names(method, [*common, BY_ORDER, BY_TIME])
        raise InputError("--join", "", f"no column {method!r} in both files", allowed)
    if len(common) == 1:
        return common[0]
    both = f"{len(points.lines)} rows here, {len(joints.lines)} in {joints.path}"
    order = f"--join {BY_ORDER} (line {points.lines[0]} to line {joints.lines[0]}, …,"
    order += f" line {points.lines[-1]} to line {joints.lines[-1]})"
    finding = "no column that both files have"
    if common:
        finding = f"several columns that both files have: {', '.join(common)}"
    raise InputError(
        points.path,
        "header",
        f"{finding}; {both}",
        f"--join COLUMN, --join {BY_TIME}, or if their rows are in one order {order}",
    )


def _read_label(text: TextTable, header: str) -> list[str]:
    """Read the labels of rows; a number is the same label in any form."""
    labels = []
    for cell in text.columns[header]:
        number = parse_number(cell.strip())
        labels.append(cell.strip() if number is None else f"{number:g}")
    return labels


def read_key(text: TextTable, name: str, header: str, notes: list[str]) -> list[str]:
    """Read the numbers of poses, loads and repeats, or the names of targets. A label
    such as P12 stands for the number in it, and `notes` gets a sentence about it."""
    cells = [cell.strip() for cell in text.columns[header]]
    if name == "target":
        return cells
    numbers = []
    for line, cell in zip(text.lines, cells, strict=True):
        match = _INTEGER.fullmatch(cell)
        value = parse_number(cell)
        if value is not None and value == int(value):
            numbers.append(str(int(value)))
        elif match and value is None:
            numbers.append(str(int(match[1])))
            note = f"{name} by the number in {header!r}: {cell!r} is {numbers[-1]}"
            if not any(earlier.startswith(f"{name} by") for earlier in notes):
                notes.append(note)
        else:
            key = f"line {line}, column {header}"
            raise InputError(text.path, key, repr(cell), f"the number of a {name}")
    return numbers


def _collect_rows(
    text: TextTable, values: Mapping[str, Sequence[str]], names: Sequence[str]
) -> _Rows:
    """Collect the values of the columns `names` in each row."""
    columns = [values[name] for name in names]
    keys = [*zip(*columns, strict=True)] if columns else [()] * len(text.lines)
    return _Rows(text.path, text.lines, keys, names)


def _pair_rows(
    measured: _Rows, groups: Mapping[tuple[str, ...], list[int]], source: str
) -> list[int]:
    """Find the partner of each measured row: the row of `source` with the same values;
    of several with the same values the next in order.

    `groups` are the rows of `source` by their values. An `InputError` refuses a row
    without a partner, and as many rows as no order can join.
    """
    pairs = [-1] * len(measured.lines)
    for key, rows in measured.group().items():
        partners = groups.get(key, [])
        description = measured.describe(rows[0])
        line = f"line {measured.lines[rows[0]]}"
        if not partners:
            raise InputError(
                measured.path,
                line,
                f"{description}, which {source} does not have",
                "rows that it has; --column and --target state what they are called",
            )
        if len(partners) == 1:
            partners = partners * len(rows)
        if len(partners) != len(rows):
            raise InputError(
                measured.path,
                line if description else "",
                f"{format_count(len(rows), 'row')} of {description or 'measurements'}",
                f"{len(partners)}, as {source} has",
            )
        for row, partner in zip(rows, partners, strict=True):
            pairs[row] = partner
    return pairs


def _refuse_doubled(rows: _Rows, several: Collection[tuple[str, ...]] = ()) -> None:
    """Refuse two rows with the same values, except `several` that may have them."""
    for key, group in rows.group().items():
        if len(group) > 1 and key not in several:
            first, second = (rows.lines[row] for row in group[:2])
            raise InputError(
                rows.path,
                f"line {second}",
                f"{rows.describe(group[0])} twice, in line {first} too",
                "one row for each",
            )


def _refuse_missing(
    planned: _Rows, pairs: Sequence[int], source: str, *, skip_empty: bool
) -> None:
    """Refuse rows of `planned` without a position, unless they may be left out."""
    missing = sorted({*range(len(planned.lines))} - {*pairs})
    if missing and not skip_empty:
        row = missing[0]
        raise InputError(
            planned.path,
            f"line {planned.lines[row]}",
            f"no position of {planned.describe(row)} in {source}"
            f" ({format_count(len(missing), 'row')} without one)",
            "a row for each, or --skip-empty to leave such rows out",
        )


def refuse_unmeasured_rows(
    sheet: TextTable, table: Mapping[str, np.ndarray], source: str
) -> None:
    """Refuse a planned sheet of which the joined `table` of some files has not all
    rows; `source` names the files."""
    planned = _collect_rows(
        sheet, _read_keys(sheet, {name: name for name in KEYS}, []), KEYS
    )
    columns = [map(str, table[name].tolist()) for name in KEYS]
    measured = {*zip(*columns, strict=True)}
    rows = [row for row, key in enumerate(planned.keys) if key in measured]
    _refuse_missing(planned, rows, source, skip_empty=False)


def _show_pairs(measured: _Rows, planned: _Rows, pairs: Sequence[int]) -> str:
    """Show the first and the last pair."""
    shown = [
        f"line {measured.lines[row]} is {planned.describe(pairs[row])}"
        for row in dict.fromkeys((0, len(pairs) - 1))
    ]
    return "; … ".join(shown)


def _append_columns(
    points: TextTable,
    other: TextTable,
    names: Collection[str],
    dropped: Collection[str],
    pairs: Sequence[int],
) -> TextTable:
    """Append columns of another table to rows of positions, without the columns
    `dropped` of these; a column that both tables have is that of the positions."""
    columns = {
        header: cells
        for header, cells in points.columns.items()
        if header not in dropped
    }
    for name in names:
        cells = other.columns[name]
        columns.setdefault(name, tuple(cells[row] for row in pairs))
    return replace(points, columns=columns, units=other.units | points.units)


def _pair_by_time(points: TextTable, joints: TextTable) -> list[int]:
    """Find the joint angles that are nearest in time to each position.

    An `InputError` refuses a position that is farther from all of them than the median
    of their intervals.
    """
    measured_s = _read_times_of(points)
    driven_s = _read_times_of(joints)
    order = np.argsort(driven_s, kind="stable")
    sorted_s = driven_s[order]
    after = np.clip(np.searchsorted(sorted_s, measured_s), 1, max(len(order) - 1, 1))
    after = np.minimum(after, len(order) - 1)
    before = np.maximum(after - 1, 0)
    is_before_nearer = measured_s - sorted_s[before] <= sorted_s[after] - measured_s
    nearest = np.where(is_before_nearer, before, after)
    gap_s = np.abs(sorted_s[nearest] - measured_s)
    interval_s = float(np.median(np.diff(sorted_s))) if len(order) > 1 else 0.0
    row = int(np.argmax(gap_s))
    if gap_s[row] > interval_s:
        raise InputError(
            points.path,
            f"line {points.lines[row]}",
            f"a time {gap_s[row]:.3g} s from any in {joints.path}",
            f"{interval_s:.3g} s at most, the interval of the times there: two clocks"
            " that show the same",
        )
    return [int(partner) for partner in order[nearest]]


def _read_times_of(text: TextTable) -> np.ndarray:
    """Read the times (N,) of a table, s."""
    for header in text.columns:
        name, unit = recognize_column(header)
        if name == "time_s":
            unit = text.units.get(header) or unit or "s"
            scales = find_scales({name: unit})
            return read_times(text.cells({name: header}, scales))
    raise InputError(text.path, "header", "no column of times", "a column time")
