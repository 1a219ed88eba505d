"""Tables with several markers in a row, such as ``A_x, A_y, A_z, B_x, B_y, B_z``: one row for each marker.

What such columns are called says of which marker they are, and not whether this is a target: it may be what was commanded. So
the markers that are targets are stated, never guessed.
"""

import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import TypeVar

from elastocal.errors import InputError
from elastocal.exchange.column_names import (
    EULER,
    HOMOGENEOUS,
    MATRIX,
    POSITION,
    QUATERNION,
    VECTOR,
    recognize_column,
    recognize_plain_header,
    split_unit,
)
from elastocal.exchange.csv_dialect import TextTable

# What a marker has of its own; all else of a row is of the robot.
_OWN = frozenset((*POSITION, *VECTOR, *QUATERNION, *EULER, *MATRIX, *HOMOGENEOUS, "u95_m"))
_BETWEEN = r"[\s_./:|\-]+"
# Words of a topic or header that say what is measured, not of what.
_WORDS = re.compile(rf"(?:^|{_BETWEEN})(?:pose|position|pos|orientation|rotation|translation|point|transform)$", re.IGNORECASE)
# Without anything between: x2, 2x, P1X, Ax.
_JOINED = (
    re.compile(r"(?P<axis>[xyz])(?P<marker>\d{1,3})", re.ASCII | re.IGNORECASE),
    re.compile(r"(?P<marker>(?:[a-z]*\d{1,3}))(?P<axis>[xyz])", re.ASCII | re.IGNORECASE),
    re.compile(r"(?P<marker>[A-Z])(?P<axis>[xyz])", re.ASCII),
)

_Value = TypeVar("_Value")
_Markers = dict[str, dict[str, str]]


def markers_in(headers: Iterable[str]) -> _Markers:
    """Headers by the names of their quantities, of each marker with a position; that of headers such as ``x`` is called ""."""
    found: _Markers = {}
    for header in headers:
        if part := _marker_and_name(split_unit(header)[0]):
            found.setdefault(part[0], {}).setdefault(part[1], header)
    return {marker: named for marker, named in found.items() if has_position(named)}


def has_position(names: Collection[str | None]) -> bool:
    """Whether names of columns are those of a position, by itself or in a homogeneous matrix."""
    return set(POSITION) <= set(names) or {"t14", "t24", "t34"} <= set(names)


def _marker_and_name(text: str) -> tuple[str, str] | None:
    """Marker and quantity of a header without its unit; None where it is neither."""
    if name := recognize_plain_header(text):
        return ("", name) if name in _OWN else None
    parts, gaps = re.split(_BETWEEN, text), [*re.finditer(_BETWEEN, text)]
    for last in (2, 1):
        if len(parts) > last and (name := recognize_plain_header(" ".join(parts[-last:]))) in _OWN:
            return _strip_marker(text[: gaps[-last].start()]), name
    for first in (2, 1):
        if len(parts) > first and (name := recognize_plain_header(" ".join(parts[:first]))) in _OWN:
            return _strip_marker(text[gaps[first - 1].end() :]), name
    match = next((match for pattern in _JOINED if (match := pattern.fullmatch(text))), None)
    return (match["marker"], match["axis"].lower()) if match else None


def _strip_marker(marker: str) -> str:
    while (shorter := _WORDS.sub("", marker)) != marker:
        marker = shorter
    return re.sub(rf"^{_BETWEEN}|{_BETWEEN}$", "", marker)


def choose_markers(
    text: TextTable, target: str | None, targets: Mapping[str, str] | None, mapped: Collection[str]
) -> dict[str, str]:
    """Markers of a table by the names of the targets that they are; empty where rows hold one position.

    `target`: name of the target of all rows; where a marker is called so, it is meant. `targets`: markers by the names of
    targets, as stated. `mapped`: names of columns that options state. Raises `InputError`: no such marker, or several positions
    in a row of which none is stated.
    """
    markers = markers_in(text.columns)
    if targets:
        for name, marker in targets.items():
            if marker not in markers:
                known = ", ".join(map(_quote_marker, markers)) or "none, each with columns for x, y and z"
                allowed = f"markers of the table: {known}"
                raise InputError(text.path, "header", f"no marker {marker!r}, target {name!r}", allowed)
        return dict(targets)
    if has_position(mapped):
        return {}
    usual = [
        marker
        for marker, named in markers.items()
        if all(recognize_column(named.get(axis, axis))[0] == axis for axis in POSITION)
    ]
    if target and target in markers and target not in usual:
        return {target: target}
    # Beside plain x, y, z a number makes another marker; x_cmd and such are no measurements.
    counted = [marker for marker in markers if marker.isdigit()]
    if len(usual) > 1 or (markers and not usual) or (usual and counted):
        asked = usual if len(usual) > 1 else [*usual, *counted] if usual else [*markers]
        first = next((marker for marker in asked if marker), asked[0])
        options = " ".join(f"--target {marker if marker else f'NAME={marker}'}" for marker in asked[:3])
        found = f"positions of {', '.join(map(_quote_marker, asked[:4]))}{' …' if len(asked) > 4 else ''} in each row"
        allowed = f"{options} for those that are targets (NAME={first} gives one another name), or --column x=NAME … for one"
        raise InputError(text.path, "header", found, allowed)
    return {}


def _quote_marker(marker: str) -> str:
    return repr(marker) if marker else "x, y, z"


def one_row_each(
    text: TextTable, targets: Mapping[str, str], mapped: Mapping[str, str]
) -> tuple[TextTable, dict[str, str], list[str]]:
    """A table with one row for each target of a row, whose columns have the headers of the first target's.

    `targets`: markers by the names of targets. `mapped`: headers by names of columns that options state. Returns the table,
    with a column of the targets' names; headers by names, those of the options among them; and notes which columns are of
    which target. Raises `InputError`: a target without a column that another has, or with another unit of it.
    """
    markers = markers_in(text.columns)
    first, *others = targets
    named = markers[targets[first]]
    for name in others:
        other = markers[targets[name]]
        for what in sorted({*named} ^ {*other}):
            header, of = (named[what], first) if what in named else (other[what], name)
            allowed = f"--ignore {header!r}, or the same of each target"
            raise InputError(text.path, "header", f"{header!r} of {of} alone", allowed)
        for what, header in named.items():
            units = [text.units.get(each) or recognize_column(each)[1] or "no unit" for each in (header, other[what])]
            if units[0] != units[1]:
                found = f"{header!r} in {units[0]} and {other[what]!r} in {units[1]}"
                raise InputError(text.path, "header", found, "one unit for what the targets have in common")
    if wrong := next((what for what, header in named.items() if mapped.get(what, header) != header), None):
        raise InputError("--column", wrong, repr(mapped[wrong]), f"{named[wrong]!r}, as {first} has it, or no --target")
    chosen = {header for marker in targets.values() for header in markers[marker].values()}
    columns = {header: _repeat(cells, len(targets)) for header, cells in text.columns.items() if header not in chosen}
    for what, header in named.items():
        each = [text.columns[markers[marker][what]] for marker in targets.values()]
        columns[header] = tuple(cell for cells in zip(*each, strict=True) for cell in cells)
    column = "target" if "target" not in columns else "marker of the row"
    columns[column] = tuple(targets) * len(text.lines)
    notes = [f"{name} has {', '.join(map(repr, markers[marker].values()))}" for name, marker in targets.items()]
    long = replace(text, columns=columns, lines=_repeat(text.lines, len(targets)))
    return long, {**mapped, **named, "target": column}, notes


def _repeat(values: Sequence[_Value], times: int) -> tuple[_Value, ...]:
    return tuple(value for value in values for _ in range(times))
