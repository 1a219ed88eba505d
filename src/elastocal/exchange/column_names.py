"""What the columns of other people's tables are: by their names, and in which unit; what is ambiguous is asked for.

A column is recognized by what it is usually called, such as ``J1``, ``A1``, ``Joint 1`` or ``q1 [deg]`` for the first joint.
Its unit stands in brackets or behind the name (``x_mm``), in a row under the names, or is stated by an option.

Messages of joint states, as rosbag and PlotJuggler write them, have joints in any order, often that of the alphabet [1]:
``position0`` stands beside ``name0``, whose cells name the joint, and counts for that joint and not for its place.

Of several markers in a row, such as ``A_x, A_y, A_z, B_x, B_y, B_z``, each makes a row of its own. What such columns are called
says of which marker they are, and not whether this is a target: it may be what was commanded. So the markers that are targets
are stated, never guessed.

[1] Open Robotics, sensor_msgs/JointState, docs.ros.org.
"""

import math
import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy import constants

from elastocal.errors import InputError, closest_first
from elastocal.exchange.csv_dialect import TextTable
from elastocal.exchange.rotations import EULER, HOMOGENEOUS, MATRIX, QUATERNION, UNIT_LENGTH, VECTOR
from elastocal.io.texts import plain_number
from elastocal.mechanics.components import WRENCH_NAMES
from elastocal.mechanics.robot import Robot

LENGTH, ANGLE, FORCE, MOMENT, TIME, TEMPERATURE, NONE = "length", "angle", "force", "moment", "time", "temperature", "none"
# SI value of one of each unit, by kind.
UNITS: dict[str, dict[str, float]] = {
    LENGTH: {"m": 1.0, "mm": 1e-3, "cm": 1e-2, "um": 1e-6, "µm": 1e-6, "in": constants.inch},
    ANGLE: {"rad": 1.0, "deg": math.radians(1.0), "°": math.radians(1.0), "mrad": 1e-3},
    FORCE: {"N": 1.0, "kN": 1e3, "kgf": constants.kgf, "lbf": constants.lbf},
    MOMENT: {"Nm": 1.0, "Nmm": 1e-3, "kNm": 1e3, "kgfm": constants.kgf, "lbfft": constants.lbf * constants.foot},
    TIME: {"s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "ns": 1e-9, "min": 60.0, "h": 3600.0},
    TEMPERATURE: {"C": 1.0, "°C": 1.0},
    NONE: {"": 1.0},
}
POSITION, TRANSLATION = ("x", "y", "z"), ("t14", "t24", "t34")
_BRACKETS = re.compile(r"(.*?)\s*[\[(]\s*(.*?)\s*[\])]\s*")
_INDEX = re.compile(r"([^\[(]*?)\s*[\[(]\s*([0-9]+)\s*[\])](.*)", re.ASCII)
# What has no unit, as people write it.
_NO_UNIT = ("", "-", "1", "#", "–", "none")
_BEHIND = re.compile(r"(.+?)[_/ ]([A-Za-zµ°]+)")
# No arm has a hundred joints, and a table is looked through for each up to the last that it names.
_JOINT = re.compile(
    r"(q|j|a|axis|joint|theta|jointangle|actualq|targetq|qactual|rax|jointpos|jointposition|jointpositions|joints)([0-9]{1,2})"
)
_APPROACH = re.compile(r"(?:approach|direction)([0-9]{1,2})")
_PLACES = ("p{}", "pos{}", "position{}", "measured{}", "{}meas", "translation{}", "point{}")
_ALSO = {
    **{axis: tuple(place.format(axis) for place in _PLACES) for axis in "xyz"},
    **{f"q{part}": (f"quat{part}", f"orientation{part}", f"rotation{part}") for part in "wxyz"},
    **{f"f{axis}": (f"force{axis}",) for axis in "xyz"},
    **{f"m{axis}": (f"moment{axis}", f"torque{axis}") for axis in "xyz"},
    **{f"r{axis}": (f"rot{axis}", angle, f"rv{axis}") for axis, angle in zip("xyz", ("roll", "pitch", "yaw"), strict=True)},
    "pose": ("poseid", "posenumber", "configuration", "config"),
    "load": ("loadid", "loadcase"),
    "repeat": ("repetition", "cycle"),
    "target": ("reflector", "smr", "marker"),
    "session": (),
    "time_s": ("time", "timestamp"),
    "temperature_c": ("temperature", "temp"),
    "u95_m": ("u95", "expandeduncertainty"),
}
_KNOWN = {other: name for name, others in _ALSO.items() for other in (name.replace("_", ""), *others)}
_KNOWN |= {name: name for name in (*EULER, *MATRIX, *HOMOGENEOUS)}
# Last but one names of topics that hold angles by their number.
_ANGLES = ("position", "positions", "jointstates", "joints", "jointpositions")
# Three positions by their number may be x, y and z.
_FEWEST_POSITIONS = 4
_COUNTED = re.compile(r"(.*?)(name|position)s?[\s_.]?[\[(]?\s*([0-9]{1,2})\s*[\])]?", re.ASCII | re.IGNORECASE)

# What a marker has of its own; all else of a row is of the robot.
_OWN = frozenset((*POSITION, *VECTOR, *QUATERNION, *EULER, *MATRIX, *HOMOGENEOUS, "u95_m"))
_BETWEEN = r"[\s_./:|\-]+"
# Words of a topic or header that say what is measured, not of what.
_WORDS = re.compile(
    rf"(?:(?:^|{_BETWEEN})(?:pose|position|pos|orientation|rotation|translation|point|transform))+$", re.IGNORECASE
)
# Without anything between: x2, 2x, P1X, Ax.
_JOINED = (
    re.compile(r"(?P<axis>[xyz])(?P<marker>\d{1,3})", re.ASCII | re.IGNORECASE),
    re.compile(r"(?P<marker>(?:[a-z]*\d{1,3}))(?P<axis>[xyz])", re.ASCII | re.IGNORECASE),
    re.compile(r"(?P<marker>[A-Z])(?P<axis>[xyz])", re.ASCII),
)


def kind_of(name: str) -> tuple[str, ...]:
    """Kinds of quantities that a column may hold, keys of `UNITS`, by the name that this module gives it."""
    if re.fullmatch(r"q[0-9]+", name):
        # A prismatic joint reports a length.
        return ANGLE, LENGTH
    if name in (*POSITION, *TRANSLATION, "u95_m"):
        return (LENGTH,)
    if name in (*VECTOR, *EULER):
        return (ANGLE,)
    if name in WRENCH_NAMES:
        return (FORCE,) if name.startswith("f") else (MOMENT,)
    return ({"time_s": TIME, "temperature_c": TEMPERATURE}.get(name, NONE),)


def is_name(name: str) -> bool:
    """Whether a column of that name can be imported."""
    return name in _ALSO or name in _KNOWN.values() or re.fullmatch(r"(q|approach)[1-9][0-9]?", name) is not None


def has_position(names: Collection[str | None]) -> bool:
    """Whether names of columns are those of a position, by itself or in a homogeneous matrix."""
    return set(POSITION) <= set(names) or set(TRANSLATION) <= set(names)


def lengths_in(headers: Iterable[str]) -> list[str]:
    """Headers of lengths that are none of a position, as of a draw wire or a ball bar."""
    parts = [(header, *split_unit(header)) for header in headers]
    called = ("l", "length", "distance", "wirelength", "wire")
    return [h for h, text, unit in parts if (unit in UNITS[LENGTH] and not _find_name(text)) or _simplify(text) in called]


def find_joints(names: Iterable[str]) -> list[str]:
    """Names of joint angles among names, from q1 on."""
    return [f"q{number}" for number in sorted(int(name[1:]) for name in names if re.fullmatch(r"q[0-9]+", name))]


def unit_scale(unit: str, kinds: Iterable[str]) -> float | None:
    """SI value of one unit, if it is one of some kinds."""
    plain = _simplify_unit(unit)
    return next((UNITS[kind][plain] for kind in kinds if plain in UNITS[kind]), None)


def read_units(cells: Sequence[str]) -> list[str] | None:
    """Units of a row that has nothing else, such as ``deg; [mm]; -``, "" for none; None where it has anything else."""
    bare = [re.sub(r"^[\[(](.*)[\])]$", r"\1", cell).strip() for cell in cells]
    units = ["" if unit in _NO_UNIT else _simplify_unit(unit) for unit in bare]
    known = {unit for of_kind in UNITS.values() for unit in of_kind}
    return units if any(units) and known.issuperset(units) else None


def recognize_column(header: str) -> tuple[str | None, str | None]:
    """What a column is, by its header.

    A number in brackets is an index, whatever else stands there a unit. Of a topic such as ``/tcp/pose/position/x`` or
    ``field.pose.position.x`` the last two names count, or the last but one before ``position``.

    Returns `name`: as this module calls columns, None where the header is not known; `unit`: as it stands in the header, None
    where none does.
    """
    text, unit = split_unit(header)
    name = _find_name(text)
    if name is not None and unit is None:
        return name, {"time_s": "s", "temperature_c": "C", "u95_m": "m"}.get(header.lower())
    return name, unit


def recognize_plain_header(text: str) -> str | None:
    """What a header without a unit is by all of it; None where it is not known, or the end of a topic."""
    plain = _simplify(text)
    for pattern, letter in ((_JOINT, "q"), (_APPROACH, "approach")):
        if match := pattern.fullmatch(plain):
            # Joint 0 is somebody's first: whose, an option or the other columns have to say.
            number = int(match[match.lastindex or 1])
            return f"{letter}{number}" if number else None
    return _KNOWN.get(plain)


def split_unit(header: str) -> tuple[str, str | None]:
    """A header without its unit, and the unit; an index in brackets is a part of the name."""
    index = _INDEX.fullmatch(header)
    if index and index[1]:
        # Of a name with a number an index is one too many.
        header = f"{index[1]}{' index ' if index[1][-1].isdigit() else ''}{index[2]}{index[3]}"
    if bracketed := _BRACKETS.fullmatch(header):
        return bracketed[1], _simplify_unit(bracketed[2]) or None
    behind = _BEHIND.fullmatch(header)
    if _find_name(header) is None and behind and any(_simplify_unit(behind[2]) in units for units in UNITS.values()):
        name = _find_name(behind[1])
        if name is None or unit_scale(behind[2], kind_of(name)) is not None:
            return behind[1], _simplify_unit(behind[2])
    return header, None


def _find_name(text: str) -> str | None:
    return next((name for plain in _names_in(text) if (name := recognize_plain_header(plain)) is not None), None)


def _names_in(text: str) -> list[str]:
    """What a header may be called: the whole of it, and of a topic its end."""
    parts = [plain for part in re.split(r"[/.]", text) if (plain := _simplify(part))]
    if len(parts) < 2:
        return [_simplify(text)]
    if parts[-1] in ("position", "pos"):
        return [_simplify(text), parts[-2]]
    alone = [parts[-1]] if _JOINT.fullmatch(parts[-1]) and parts[-2] in _ANGLES else []
    return [_simplify(text), parts[-2] + parts[-1], *alone]


def _simplify(text: str) -> str:
    return re.sub(r"[^a-z0-9]", "", text.lower())


def _simplify_unit(unit: str) -> str:
    return re.sub(r"[ ·*.⋅]", "", unit).replace("degrees", "deg").replace("degree", "deg")


def _unit_of_joint(header: str, joint: str) -> tuple[bool, str | None]:
    """Whether a column has the name of a joint (alone, with a unit, or as a topic has it), and the unit."""
    if _simplify(joint) in _names_in(header):
        return True, None
    text, unit = split_unit(header)
    return _simplify(joint) in _names_in(text), unit


def find_columns(
    text: TextTable, mapped: Mapping[str, str], robot: Robot | None
) -> tuple[dict[str, str], dict[str, str], list[str]]:
    """Headers by name, those of the options first, the units that headers state, and notes."""
    for header in mapped.values():
        if header not in text.columns:
            raise InputError(text.path, "header", f"no column {header!r}", closest_first(header, list(text.columns)))

    def with_unit(header: str, name: str | None, unit: str | None) -> tuple[str | None, str | None]:
        """The row under the header may state the unit, and may not contradict it."""
        below = text.units.get(header)
        if unit and below and unit != below:
            allowed = f"one unit; --ignore {header!r}, or a table with one of them"
            raise InputError(text.path, "header", f"{header!r} and {below!r} in the row under it", allowed)
        return name, unit or below

    found, known, joint_names = dict(mapped), {*mapped.values()}, (robot and robot.joint_names) or ()
    guesses = {header: with_unit(header, *recognize_column(header)) for header in text.columns}
    certain: set[str] = set()
    for joint, called in enumerate(joint_names, 1):
        for header in text.columns:
            is_joint, unit = _unit_of_joint(header, called)
            if is_joint:
                guesses[header] = with_unit(header, f"q{joint}", unit)
                certain.add(header)
    named = _find_joints_by_name(text, joint_names, known)
    parts = {name: header for header, (name, _) in guesses.items() if name in QUATERNION}
    if parts.keys() == {"qx", "qy", "qz"} and "qw" not in mapped:
        # With the other three parts of a quaternion q0 has length 1.
        zero = [header for header in text.columns if _simplify(header) == "q0" and header not in known]
        named |= {header: "qw" for header in zero if _have_unit_length(text, [header, *parts.values()])}
    guesses |= {header: (name, guesses[header][1]) for header, name in named.items()}
    certain |= {*named}
    free = [header for header in text.columns if header not in certain and guesses[header][0] not in mapped]
    joints, notes = _find_counted_joints(text, free, known)
    guesses |= {header: (name, guesses[header][1]) for header, name in joints.items()}
    stated: dict[str, str] = {}
    for header, (guess, unit) in guesses.items():
        meant = next((name for name, named in mapped.items() if named == header), guess)
        if meant is None or mapped.get(meant, header) != header:
            continue
        if found.get(meant, header) != header:
            allowed = f"--column {meant}=NAME, or --ignore NAME"
            raise InputError(text.path, "header", f"both {found[meant]!r} and {header!r} for {meant}", allowed)
        if meant not in mapped and unit not in (None, *_NO_UNIT) and kind_of(meant) == (NONE,):
            allowed = (
                f"--ignore {header!r}, --column {meant}={header!r} where it numbers or names each {meant}, or --column NAME=…"
            )
            raise InputError(text.path, "header", f"{header!r}, a {meant} with a unit", allowed)
        found[meant] = header
        if unit is not None:
            stated[meant] = unit
    return found, stated, notes


def _find_joints_by_name(text: TextTable, joint_names: Sequence[str], mapped: set[str]) -> dict[str, str]:
    """Names of joint angles by the headers of positions beside which columns name the joints.

    `joint_names`: as the robot has them; empty where nobody knows. `mapped`: headers that options state. Raises `InputError`:
    a name that changes from row to row, or joints whose order nothing states.
    """
    families: dict[tuple[str, str], dict[int, str]] = {}
    for header in text.columns:
        if match := _COUNTED.fullmatch(split_unit(header)[0]):
            families.setdefault((match[1], match[2].lower()), {})[int(match[3])] = header
    found: dict[str, str] = {}
    for (prefix, kind), names in families.items():
        positions = families.get((prefix, "position"), {})
        if kind != "name" or positions.keys() != names.keys() or mapped & {*positions.values()}:
            continue
        for number, header in names.items():
            called, *others = dict.fromkeys(text.columns[header])
            if others:
                line = text.lines[text.columns[header].index(others[0])]
                allowed = f"one joint in each column; it is {called!r} in line {text.lines[0]}"
                raise InputError(text.path, f"line {line}, column {header}", repr(others[0]), allowed)
            joint = next((f"q{j}" for j, name in enumerate(joint_names, 1) if _unit_of_joint(called, name)[0]), None)
            joint = joint or (None if joint_names else recognize_column(called)[0])
            if joint and find_joints([joint]):
                found[positions[number]] = joint
        if not found:
            words = f"joints called {', '.join(text.columns[each][0] for each in names.values())}, in an order that need not be"
            first = next(iter(positions.values()))
            allowed = f"--robot FILE whose joint_names are these, or --column q1={first!r} …, each joint's"
            raise InputError(text.path, "header", f"{words} the arm's", allowed)
    return found


def _find_counted_joints(text: TextTable, headers: Sequence[str], mapped: set[str]) -> tuple[dict[str, str], list[str]]:
    """Names of joints that headers count, and notes; what may be a quaternion, or is counted in two ways, is asked for."""
    families: dict[str, dict[int, str]] = {}
    for header in headers:
        matches = (_JOINT.fullmatch(name) for name in _names_in(split_unit(header)[0]))
        if match := next(filter(None, matches), None):
            families.setdefault(match[1], {}).setdefault(int(match[2]), header)
    notes = []
    if not families:
        # Of a message of joint states without the names beside.
        counted = {header: match for header in text.columns if (match := _COUNTED.fullmatch(split_unit(header)[0]))}
        members = {int(match[3]): header for header, match in counted.items() if match[2].lower() == "position"}
        alone = len(members) == len(counted) and {*members.values()} <= {*headers}
        if len(members) >= _FEWEST_POSITIONS and alone:
            families = {"position": members}
            notes = [f"{members[min(members)]!r} … taken for joints in the arm's order, as no columns name them"]
    # What options name needs no question, unless they name a part of what is counted from 0.
    families = {
        name: members if 0 in members and not mapped >= {*members.values()} else free
        for name, members in families.items()
        if (free := {number: header for number, header in members.items() if header not in mapped})
    }
    for members in families.values():
        headers = [members[number] for number in sorted(members)]
        if sorted(members) in ([0, 1, 2, 3], [1, 2, 3, 4]) and _have_unit_length(text, headers):
            other = next((each for each in families.values() if each is not members), {1: "NAME"})
            allowed = (
                f"--column qw={headers[0]!r} … qz={headers[3]!r} (real part first) and --column q1={other[min(other)]!r} …, or "
                f"for joints --column q1={headers[0]!r} …"
            )
            found = f"{', '.join(headers)}: joints, or quaternions, as they have length 1"
            raise InputError(text.path, "header", found, allowed)
    if len(families) > 1 and not set.intersection(*(set(members) - {0} for members in families.values())):
        named = " and ".join(repr(members[min(members)]) for members in families.values())
        allowed = "--column q1=NAME …, or --ignore NAME for those of one kind"
        raise InputError(text.path, "header", f"joints called {named} …", allowed)
    for members in families.values():
        if 0 in members:
            headers = [members[number] for number in sorted(members)]
            if len(members) != max(members) + 1 or len(members) == 4 or mapped & {*members.values()}:
                allowed = f"--column q1={headers[0]!r} …, each joint's"
                raise InputError(text.path, "header", f"{', '.join(headers)}, counted from 0", allowed)
            note = f"joints counted from 0: q1 is {headers[0]!r}, q{len(headers)} is {headers[-1]!r}"
            return {header: f"q{number + 1}" for number, header in members.items()}, [note, *notes]
    return ({header: f"q{number}" for number, header in families["position"].items()} if notes else {}), notes


def _have_unit_length(text: TextTable, headers: Sequence[str]) -> bool:
    rows = [[plain_number(cell) for cell in cells] for cells in zip(*(text.columns[header] for header in headers), strict=True)]
    numbers = np.array([row for row in rows if None not in row], float)
    return len(numbers) > 0 and bool((np.abs(np.linalg.norm(numbers, axis=1) - 1.0) <= UNIT_LENGTH).all())


def markers_in(headers: Iterable[str]) -> dict[str, dict[str, str]]:
    """Headers by the names of their quantities, of each marker with a position; that of headers such as ``x`` is called ""."""
    found: dict[str, dict[str, str]] = {}
    for header in headers:
        if part := _marker_and_name(split_unit(header)[0]):
            found.setdefault(part[0], {}).setdefault(part[1], header)
    return {marker: named for marker, named in found.items() if has_position(named)}


def _marker_and_name(text: str) -> tuple[str, str] | None:
    """Marker and quantity of a header without its unit; None where it is neither."""
    if name := recognize_plain_header(text):
        return ("", name) if name in _OWN else None
    parts, gaps = re.split(_BETWEEN, text), [*re.finditer(_BETWEEN, text)]
    # The quantity is in the last words or in the first, the marker in the others.
    for words, marker in (
        *((parts[-last:], text[: gaps[-last].start()]) for last in (2, 1) if len(parts) > last),
        *((parts[:first], text[gaps[first - 1].end() :]) for first in (2, 1) if len(parts) > first),
    ):
        if (name := recognize_plain_header(" ".join(words))) in _OWN:
            return re.sub(rf"^{_BETWEEN}|{_BETWEEN}$", "", _WORDS.sub("", marker)), name
    match = next((match for pattern in _JOINED if (match := pattern.fullmatch(text))), None)
    return (match["marker"], match["axis"].lower()) if match else None


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
                known = _quoted(markers) or "none, each with columns for x, y and z"
                raise InputError(
                    text.path, "header", f"no marker {marker!r}, target {name!r}", f"markers of the table: {known}"
                )
        return dict(targets)
    if has_position(mapped):
        return {}
    usual = [name for name, named in markers.items() if all(recognize_column(named.get(a, a))[0] == a for a in POSITION)]
    if target and target in markers and target not in usual:
        return {target: target}
    # Beside plain x, y, z a number makes another marker; x_cmd and such are no measurements.
    asked = usual + ([marker for marker in markers if marker.isdigit()] if len(usual) == 1 else [])
    asked = asked or [*markers]
    if len(asked) > 1 or (asked and not usual):
        first = next((marker for marker in asked if marker), asked[0])
        options = " ".join(f"--target {marker if marker else f'NAME={marker}'}" for marker in asked[:3])
        found = f"positions of {_quoted(asked[:4])}{' …' if len(asked) > 4 else ''} in each row"
        allowed = f"{options} for those that are targets (NAME={first} gives one another name), or --column x=NAME … for one"
        raise InputError(text.path, "header", found, allowed)
    return {}


def _quoted(markers: Iterable[str]) -> str:
    return ", ".join(repr(marker) if marker else "x, y, z" for marker in markers)


def one_row_each(
    text: TextTable, targets: Mapping[str, str], mapped: Mapping[str, str]
) -> tuple[TextTable, dict[str, str], list[str]]:
    """A table with one row for each target of a row, whose columns have the headers of the first target's.

    `targets`: markers by the names of targets. `mapped`: headers by names of columns that options state. Returns the table,
    with a column of the targets' names; headers by names, those of the options among them; and notes which columns are of
    which target. Raises `InputError`: a target without a column that another has, or with another unit of it.
    """
    each = {name: markers_in(text.columns)[marker] for name, marker in targets.items()}
    first, named = next(iter(each.items()))
    for name, other in each.items():
        for what in sorted({*named} ^ {*other}):
            header, of = (named[what], first) if what in named else (other[what], name)
            allowed = f"--ignore {header!r}, or the same of each target"
            raise InputError(text.path, "header", f"{header!r} of {of} alone", allowed)
        for what, header in named.items():
            units = [text.units.get(one) or recognize_column(one)[1] or "no unit" for one in (header, other[what])]
            if units[0] != units[1]:
                found = f"{header!r} in {units[0]} and {other[what]!r} in {units[1]}"
                raise InputError(text.path, "header", found, "one unit for what the targets have in common")
    if wrong := next((what for what, header in named.items() if mapped.get(what, header) != header), None):
        raise InputError("--column", wrong, repr(mapped[wrong]), f"{named[wrong]!r}, as {first} has it, or no --target")
    chosen = {header for other in each.values() for header in other.values()}
    columns = {
        name: tuple(cell for cell in cells for _ in targets) for name, cells in text.columns.items() if name not in chosen
    }
    for what, header in named.items():
        columns[header] = tuple(
            cell for row in zip(*(text.columns[o[what]] for o in each.values()), strict=True) for cell in row
        )
    column = "target" if "target" not in columns else "marker of the row"
    columns[column] = tuple(targets) * len(text.lines)
    notes = [f"{name} has {', '.join(map(repr, other.values()))}" for name, other in each.items()]
    long = replace(text, columns=columns, lines=tuple(line for line in text.lines for _ in targets))
    return long, {**mapped, **named, "target": column}, notes
