"""What the columns of a table are: each name, its unit and the notation of orientations; what is ambiguous is asked for.

Messages of joint states, as rosbag and PlotJuggler write them, have joints in any order, often that of the alphabet [1]:
``position0`` stands beside ``name0``, whose cells name the joint, and counts for that joint and not for its place.

[1] Open Robotics, sensor_msgs/JointState, docs.ros.org.
"""

import re
from collections.abc import Mapping, Sequence

import numpy as np

from elastocal.counting import counted
from elastocal.errors import InputError, closest_first
from elastocal.exchange.column_names import (
    ANGLE,
    EULER,
    LENGTH,
    NONE,
    QUATERNION,
    USUAL,
    VECTOR,
    find_joints,
    is_unit_of_none,
    kind_of,
    ordinal_of_joint,
    recognize_column,
    split_unit,
    unit_of_joint,
    unit_scale,
    units_of,
)
from elastocal.exchange.csv_dialect import TextTable
from elastocal.exchange.rotations import (
    ALLOWED,
    HOMOGENEOUS_MATRICES,
    MATRICES,
    NO_ROTATION,
    QUATERNIONS,
    UNIT_LENGTH,
    columns_of_rotation,
    is_rotation,
)
from elastocal.io.texts import plain_number
from elastocal.mechanics.robot import Robot

# Columns that a table may have in two meanings: external axes E1 to E3 beside an orientation.
_OTHER_ANGLES = (("A", "B", "C"), ("W", "P", "R"), ("O", "A", "T"))
_COUNTED = re.compile(r"(.*?)(name|position)s?[\s_.]?[\[(]?\s*([0-9]{1,2})\s*[\])]?", re.ASCII | re.IGNORECASE)


def find_columns(
    text: TextTable, mapped: Mapping[str, str], robot: Robot | None
) -> tuple[dict[str, str], dict[str, str], list[str]]:
    """Headers by name, those of the options first, the units that headers state, and notes."""
    found: dict[str, str] = {}
    for name, header in mapped.items():
        if header not in text.columns:
            raise InputError(text.path, "header", f"no column {header!r}", closest_first(header, list(text.columns)))
        found[name] = header
    guesses = {
        header: (name, _unit(text, header, unit)) for header in text.columns for name, unit in [recognize_column(header)]
    }
    by_name = {}
    for joint, called in enumerate((robot and robot.joint_names) or (), 1):
        for header in text.columns:
            is_joint, unit = unit_of_joint(header, called)
            if is_joint:
                guesses[header], by_name[header] = (f"q{joint}", _unit(text, header, unit)), called
    for header, name in _find_joints_by_name(text, (robot and robot.joint_names) or (), {*mapped.values()}).items():
        guesses[header], by_name[header] = (name, guesses[header][1]), name
    free = [header for header in text.columns if header not in by_name and guesses[header][0] not in mapped]
    joints, notes = _find_counted_joints(text, free, {*mapped.values()})
    guesses |= {header: (name, guesses[header][1]) for header, name in joints.items()}
    stated: dict[str, str] = {}
    for header, (guess, unit) in guesses.items():
        meant = next((name for name, named in mapped.items() if named == header), guess)
        if meant is None or mapped.get(meant, header) != header:
            continue
        if found.get(meant, header) != header:
            allowed = f"--column {meant}=NAME, or --ignore NAME"
            raise InputError(text.path, "header", f"both {found[meant]!r} and {header!r} for {meant}", allowed)
        if meant not in mapped and is_unit_of_none(meant, unit):
            allowed = (
                f"--ignore {header!r}, --column {meant}={header!r} where it numbers or names each {meant}, or --column NAME=…"
            )
            raise InputError(text.path, "header", f"{header!r}, a {meant} with a unit", allowed)
        found[meant] = header
        if unit is not None:
            stated[meant] = unit
    return found, stated, notes


def _unit(text: TextTable, header: str, stated: str | None) -> str | None:
    """Unit of a column by its header or by the row under it, which may not contradict each other."""
    below = text.units.get(header)
    if stated and below and stated != below:
        allowed = f"one unit; --ignore {header!r}, or a table with one of them"
        raise InputError(text.path, "header", f"{header!r} and {below!r} in the row under it", allowed)
    return stated or below


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
            if other := next((cell for cell in text.columns[header] if cell != text.columns[header][0]), None):
                line = text.lines[text.columns[header].index(other)]
                allowed = f"one joint in each column; it is {text.columns[header][0]!r} in line {text.lines[0]}"
                raise InputError(text.path, f"line {line}, column {header}", repr(other), allowed)
            called = text.columns[header][0]
            joint = next((f"q{j}" for j, name in enumerate(joint_names, 1) if unit_of_joint(called, name)[0]), None)
            joint = joint or (None if joint_names else recognize_column(called)[0])
            if joint and re.fullmatch("q[0-9]+", joint):
                found[positions[number]] = joint
        if not found:
            called = ", ".join(text.columns[header][0] for header in names.values())
            allowed = (
                f"--robot FILE whose joint_names are these, or --column q1={next(iter(positions.values()))!r} …, each joint's"
            )
            raise InputError(text.path, "header", f"joints called {called}, in an order that need not be the arm's", allowed)
    return found


def _find_counted_joints(text: TextTable, headers: Sequence[str], mapped: set[str]) -> tuple[dict[str, str], list[str]]:
    """Names of joints that headers count, and notes; what may be a quaternion, or is counted in two ways, is asked for."""
    families: dict[str, dict[int, str]] = {}
    for header in headers:
        if counted := ordinal_of_joint(header):
            families.setdefault(counted[0], {}).setdefault(counted[1], header)
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
            first = other[min(other)]
            allowed = (
                f"--column qw={headers[0]!r} … qz={headers[3]!r} (real part first) and --column q1={first!r} …, or "
                f"for joints --column q1={headers[0]!r} …"
            )
            found = f"{', '.join(headers)}: joints, or quaternions, as they have length 1"
            raise InputError(text.path, "header", found, allowed)
    numbered = [set(members) - {0} for members in families.values()]
    if len(families) > 1 and not set.intersection(*numbered):
        named = " and ".join(repr(members[min(members)]) for members in families.values())
        allowed = "--column q1=NAME …, or --ignore NAME for those of one kind"
        raise InputError(text.path, "header", f"joints called {named} …", allowed)
    for members in families.values():
        if 0 not in members:
            continue
        headers = [members[number] for number in sorted(members)]
        if len(members) != max(members) + 1 or len(members) == 4 or mapped & {*members.values()}:
            allowed = f"--column q1={headers[0]!r} …, each joint's"
            raise InputError(text.path, "header", f"{', '.join(headers)}, counted from 0", allowed)
        return (
            {header: f"q{number + 1}" for number, header in members.items()},
            [f"joints counted from 0: q1 is {headers[0]!r}, q{len(headers)} is {headers[-1]!r}"],
        )
    return {}, []


def _have_unit_length(text: TextTable, headers: Sequence[str]) -> bool:
    rows = [[plain_number(cell) for cell in cells] for cells in zip(*(text.columns[header] for header in headers), strict=True)]
    numbers = np.array([row for row in rows if None not in row], float)
    return len(numbers) > 0 and bool((np.abs(np.linalg.norm(numbers, axis=1) - 1.0) <= UNIT_LENGTH).all())


def find_rotation(text: TextTable, columns: Mapping[str, str], mapped: Mapping[str, str], notation: str | None) -> str:
    """Notation of the orientations of a table: the one that is stated, or the one that the names of columns leave.

    `columns`: headers by name. `mapped`: those of them that options state. Raises `InputError` where it is ambiguous.
    """
    if notation is not None:
        if not is_rotation(notation):
            raise InputError("--rotation", "", repr(notation), ALLOWED)
        orientation = columns_of_rotation(notation, columns)
        if orientation == EULER:
            _check_external_axes(text, columns, mapped)
        return notation
    for certain in (HOMOGENEOUS_MATRICES, QUATERNIONS, MATRICES):
        if all(name in columns for name in columns_of_rotation(certain, columns)):
            return certain
    if part := [columns[name] for name in QUATERNION if name in columns]:
        allowed = "--column qw=NAME and such for what is missing, or --rotation none"
        raise InputError(text.path, "header", f"a part of a quaternion, {', '.join(part)}", allowed)
    if angles := [columns[name] for name in (*VECTOR, *EULER) if name in columns]:
        allowed = f"--rotation vector, euler:ZYX, euler:xyz … or none: {ALLOWED}"
        raise InputError(text.path, "header", f"orientations {', '.join(angles)} of an unknown notation", allowed)
    return NO_ROTATION


def _check_external_axes(text: TextTable, columns: Mapping[str, str], mapped: Mapping[str, str]) -> None:
    """Ask where angles ``E1`` to ``E3`` may be external axes, as other columns look like the orientation."""
    plain = {re.split(r"[\[(]", header)[0].strip().upper(): header for header in text.columns}
    guessed = [columns[name] for name in EULER if name in columns and name not in mapped]
    others = [[plain[letter] for letter in letters] for letters in _OTHER_ANGLES if all(letter in plain for letter in letters)]
    more = [header for name, header in plain.items() if name in ("E4", "E5", "E6")]
    if guessed and (others or more):
        other_names = others[0] if others else ["NAME", "NAME", "NAME"]
        allowed = " ".join(f"--column {name}={header!r}" for name, header in zip(EULER, other_names, strict=True))
        own = " or ".join([f"{', '.join(guessed)} (external axes?)", *(", ".join(each) for each in others)])
        raise InputError(text.path, "header", f"orientations in {own}", f"{allowed}, or the same with {', '.join(guessed)}")


def check_complete(
    text: TextTable, columns: Mapping[str, str], angles: Sequence[str], needed: Sequence[str], robot: Robot | None
) -> None:
    """Refuse a table without all joint angles of the robot (`angles`), or without one of the columns that are needed."""
    if not angles:
        named = f" or as the robot has them: {', '.join(robot.joint_names)}" if robot and robot.joint_names else ""
        allowed = (
            f"columns q1, q2 …{named}, --column q1=NAME, or --robot FILE with joint_names; "
            f"not yet used: {_list_unused(text, columns)}"
        )
        raise InputError(text.path, "header", "no joint angles", allowed)
    if robot and len(angles) > robot.joints:
        found = f"{counted(len(angles), 'joint')}: {', '.join(columns[name] for name in angles)}"
        raise InputError(text.path, "header", found, f"{robot.joints}, as {robot.name} has; --ignore NAME leaves a column out")
    last = robot.joints if robot else int(angles[-1][1:])
    for group in ([f"q{j}" for j in range(1, last + 1)], needed):
        if missing := [name for name in group if name not in columns]:
            allowed = f"--column {missing[0]}=NAME; not yet used: {_list_unused(text, columns)}"
            raise InputError(text.path, "header", f"no column {', '.join(missing)}", allowed)


def _list_unused(text: TextTable, columns: Mapping[str, str]) -> str:
    return ", ".join(header for header in text.columns if header not in columns.values())[:200] or "none"


def find_units(
    text: TextTable,
    columns: Mapping[str, str],
    wanted: Sequence[str],
    stated: Mapping[str, str],
    given: Mapping[str, str],
    robot: Robot | None = None,
) -> dict[str, str]:
    """Units of wanted columns by their names: by options, by headers, or of what has a usual unit that one.

    `stated`: by headers. `given`: by options, ``angles`` and ``lengths`` for all that have no other. Raises `InputError`: no
    unit, or one of another kind.
    """
    found: dict[str, str] = {}
    for name in wanted:
        kinds = kind_of(name)
        if robot and name in find_joints([name]):
            # A prismatic joint reports a length.
            kinds = (LENGTH if robot.chain.prismatic[int(name[1:]) - 1] else ANGLE,)
        if kinds == (NONE,):
            continue
        for_all = given.get("lengths" if kinds[0] == LENGTH else "angles")
        # Options go before headers, those for one column before those for all.
        unit = given.get(name) or stated.get(name) or USUAL.get(kinds[0]) or for_all
        if unit is None:
            option = "--lengths mm" if kinds[0] == LENGTH else "--angles deg"
            raise InputError(text.path, "header", f"no unit of {columns[name]!r}", f"{option} or such, or --unit {name}=UNIT")
        if unit_scale(unit, kinds) is None:
            allowed = f"{', '.join(units_of(kinds))}, by --unit {name}=UNIT"
            raise InputError(text.path, f"unit of {columns[name]!r}", repr(unit), allowed)
        found[name] = unit
    return found
