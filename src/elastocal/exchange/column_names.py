"""Recognize the columns of tables from other programs, and their units.

A column is recognized by its usual names, such as ``J1``, ``A1``, ``Joint 1`` or ``q1
[deg]`` for the first joint. Its unit is in brackets or behind the name (``x_mm``), in a
row under the names, or an option states it. Orientations have several notations, some of
which are recognized by their columns. If a table is ambiguous, an error asks the user.
"""

import itertools
import re
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib import resources

import numpy as np
import yaml
from scipy.spatial.transform import Rotation

from elastocal.campaigns.tables import TextTable
from elastocal.errors import InputError, suggest_names
from elastocal.mechanics.robot import Robot

LENGTH = "length"
ANGLE = "angle"
NONE = "none"
_VOCABULARY = yaml.safe_load(
    resources.files(__package__).joinpath("column_names.yaml").read_text("utf-8")
)
# SI values of the units, by kind of quantity.
UNITS: dict[str, dict[str, float]] = _VOCABULARY["units"]
POSITION = ("x", "y", "z")
TRANSLATION = ("t14", "t24", "t34")
VECTOR = ("rx", "ry", "rz")
EULER = ("e1", "e2", "e3")
NO_ROTATION = "none"
QUATERNIONS = "quaternion"
HOMOGENEOUS_MATRICES = "homogeneous"
EULER_ANGLES = "euler:"
# Three axes, neighbouring ones different.
_EULER_NOTATION = re.compile(r"euler:(?!.*(.)\1)([XYZ]{3}|[xyz]{3})")
# Columns of each notation. The columns of some identify their notation.
_NOTATIONS: dict[str, list[str]] = _VOCABULARY["rotations"]
_CERTAIN = (HOMOGENEOUS_MATRICES, QUATERNIONS, "matrix")
_ALLOWED = (
    "none, vector, quaternion, matrix, homogeneous, or euler: with three axes such as"
    " euler:ZYX (about axes that turn with the body; small letters, euler:xyz: about"
    " fixed ones)"
)
# Upper bound on the error of a quaternion's length and of a matrix product R' R; rounding
# to four digits causes less.
UNIT_LENGTH = 2e-3
# A header with a unit, or with an index, in brackets.
_BRACKETS = re.compile(r"(.*?)\s*[\[(]\s*(.*?)\s*[\])]\s*")
_INDEX = re.compile(r"([^\[(]*?)\s*[\[(]\s*([0-9]+)\s*[\])](.*)", re.ASCII)
# How people write that a column has no unit.
_NO_UNIT = ("", "-", "1", "#", "–", "none")
# A header that ends with a unit, such as ``x_mm``.
_UNIT_AT_END = re.compile(r"(.+?)[_/ ]([A-Za-zµ°]+)")
# Names of joint angles. A joint has at most two digits; a larger number does not belong
# to a joint.
_JOINT = re.compile(
    r"(q|j|a|axis|joint|actuator|theta|jointangle|actualq|targetq|qactual|rax|jointpos|jointposition|jointpositions|joints)([0-9]{1,2})"
)
_APPROACH = re.compile(r"(?:approach|direction)([0-9]{1,2})")
# Names of columns by their simplified headers. Only options name Euler angles, because E1
# to E3 may be external axes.
_NAMES: dict[str, str] = {}
for _columns in _NOTATIONS.values():
    _NAMES |= zip(_columns, _columns, strict=True)
for _name, _headers in _VOCABULARY["headers"].items():
    _NAMES |= dict.fromkeys((_name, *_headers), _name)


def list_kinds(name: str) -> tuple[str, ...]:
    """List the kinds of quantities, keys of `UNITS`, that a column of this name may
    hold."""
    if re.fullmatch(r"q[0-9]+", name):
        # A prismatic joint reports a length.
        return ANGLE, LENGTH
    for kind, columns in _VOCABULARY["kinds"].items():
        if name in columns:
            return (kind,)
    return (NONE,)


def is_name(name: str) -> bool:
    """Decide whether a column of this name can be imported."""
    return (
        name in {*_NAMES.values(), *EULER}
        or re.fullmatch(r"(q|approach)[1-9][0-9]?", name) is not None
    )


def has_position(names: Collection[str | None]) -> bool:
    """Decide whether columns of these names have a position, by itself or in a
    homogeneous matrix."""
    return set(POSITION) <= set(names) or set(TRANSLATION) <= set(names)


def find_lengths(headers: Iterable[str]) -> list[str]:
    """Find headers of lengths that belong to no position, such as those of a draw wire or
    a ball bar."""
    names = ("l", "length", "distance", "wirelength", "wire")
    lengths = []
    for header in headers:
        text, unit = split_unit(header)
        has_length_unit = unit in UNITS[LENGTH] and not _find_name(text)
        if has_length_unit or _simplify(text) in names:
            lengths.append(header)
    return lengths


def find_joints(names: Iterable[str]) -> list[str]:
    """Find the names of joint angles, in the order of the joints."""
    angles = [name for name in names if re.fullmatch(r"q[0-9]+", name)]
    joints = sorted(int(name[1:]) for name in angles)
    return [f"q{joint}" for joint in joints]


def _scale(unit: str, kinds: Iterable[str]) -> float | None:
    """SI value of a unit, or None if it belongs to none of these kinds."""
    symbol = _simplify_unit(unit)
    for kind in kinds:
        if symbol in UNITS[kind]:
            return UNITS[kind][symbol]
    return None


def find_scales(units: Mapping[str, str]) -> dict[str, float]:
    """Find the SI values of the units of columns, by the names of the columns."""
    return {name: _scale(unit, list_kinds(name)) or 1.0 for name, unit in units.items()}


def read_units(cells: Sequence[str]) -> list[str] | None:
    """Read a row that has only units, such as ``deg; [mm]; -``; "" stands for no unit.

    Returns None if the row has anything else.
    """
    texts = [re.sub(r"^[\[(](.*)[\])]$", r"\1", cell).strip() for cell in cells]
    units = ["" if text in _NO_UNIT else _simplify_unit(text) for text in texts]
    known_units = set(itertools.chain.from_iterable(UNITS.values()))
    return units if any(units) and known_units.issuperset(units) else None


def recognize_column(header: str) -> tuple[str | None, str | None]:
    """Recognize name and unit of a column; each is None if the header does not state it.

    A number in brackets is an index; any other text in brackets is a unit.
    """
    text, unit = split_unit(header)
    name = _find_name(text)
    if name is not None and unit is None:
        unit = {"time_s": "s", "temperature_c": "C", "u95_m": "m"}.get(header.lower())
    return name, unit


def split_unit(header: str) -> tuple[str, str | None]:
    """Split a header into its text and its unit; an index in brackets belongs to the
    text."""
    index = _INDEX.fullmatch(header)
    if index and index[1]:
        # A name that ends with a digit must not absorb the index.
        separator = " index " if index[1][-1].isdigit() else ""
        header = f"{index[1]}{separator}{index[2]}{index[3]}"
    in_brackets = _BRACKETS.fullmatch(header)
    if in_brackets:
        return in_brackets[1], _simplify_unit(in_brackets[2]) or None
    at_end = _UNIT_AT_END.fullmatch(header)
    if at_end and _find_name(header) is None:
        text, unit = at_end.groups()
        name = _find_name(text)
        kinds = UNITS if name is None else list_kinds(name)
        if _scale(unit, kinds) is not None:
            return text, _simplify_unit(unit)
    return header, None


def _find_name(text: str) -> str | None:
    """Find the name of a column from its header, None if it is unknown."""
    plain = _simplify(text)
    for pattern, letter in ((_JOINT, "q"), (_APPROACH, "approach")):
        match = pattern.fullmatch(plain)
        if match:
            number = int(match[match.lastindex or 1])
            # If a table counts from joint 0, an option must state the first joint.
            if number:
                return f"{letter}{number}"
    return _NAMES.get(plain)


def _simplify(text: str) -> str:
    return re.sub(r"[^a-z0-9]", "", text.lower())


def _simplify_unit(unit: str) -> str:
    symbol = re.sub(r"[ ·*.⋅]", "", unit)
    return re.sub("degrees?", "deg", symbol)


@dataclass(frozen=True)
class _Header:
    """A header of a table.

    Attributes
    ----------
    text : the header itself.
    name : name of the column in this module, None if it is unknown.
    unit : None if none is stated.
    """

    text: str
    name: str | None
    unit: str | None


def find_columns(
    text: TextTable, mapped: Mapping[str, str], robot: Robot | None
) -> tuple[dict[str, str], dict[str, str]]:
    """Find the columns of a table by their names.

    Parameters
    ----------
    text : the table
    mapped : headers that options state, by name
    robot : robot whose joints columns may be named after

    Returns
    -------
    columns : headers by name, those of the options first.
    stated_units : units by name, from the headers and the row under them.

    Raises
    ------
    InputError
        A stated header is missing, two columns have one name, or a header is ambiguous.
    """
    for stated_header in mapped.values():
        if stated_header not in text.columns:
            raise InputError(
                text.path,
                "header",
                f"no column {stated_header!r}",
                suggest_names(stated_header, list(text.columns)),
            )
    mapped = _name_joints_from_zero(text, mapped)
    columns = dict(mapped)
    stated_units: dict[str, str] = {}
    for header in _recognize_headers(text, mapped, robot):
        _refuse_count_from_zero(text, mapped, header)
        name = header.name
        # An option may state another column of this name.
        if name is None or mapped.get(name, header.text) != header.text:
            continue
        if columns.get(name, header.text) != header.text:
            raise _duplicate_error(text, name, columns[name], header.text)
        has_unit = header.unit not in (None, *_NO_UNIT)
        if has_unit and name not in mapped and list_kinds(name) == (NONE,):
            raise InputError(
                text.path,
                "header",
                f"{header.text!r}, a {name} with a unit",
                (
                    f"--ignore {header.text!r}, --column {name}={header.text!r} where it"
                    f" numbers or names each {name}, or --column NAME=…"
                ),
            )
        columns[name] = header.text
        if header.unit is not None:
            stated_units[name] = header.unit
    return columns, stated_units


def _name_joints_from_zero(
    text: TextTable, mapped: Mapping[str, str]
) -> dict[str, str]:
    """Name all joints of a table that counts them from 0, if an option names its joint 0
    as the first; joints that options name themselves stay as they are."""
    numbers = {}
    for header in text.columns:
        joint = _JOINT.fullmatch(_simplify(split_unit(header)[0]))
        if joint:
            numbers[header] = (joint[1], int(joint[2]))
    family, first = numbers.get(mapped.get("q1", ""), ("", -1))
    named = dict(mapped)
    if first == 0:
        for header, (letters, number) in numbers.items():
            if letters == family and header not in mapped.values():
                named.setdefault(f"q{number + 1}", header)
    return named


def find_euler_columns(text: TextTable, notation: str | None) -> dict[str, str]:
    """Find the headers of Euler angles, by name, that a controller with this notation
    calls by letters, such as A, B and C; none if the table lacks one of them."""
    letters = _VOCABULARY["euler_headers"].get(notation, ())
    headers = {_simplify(split_unit(header)[0]): header for header in text.columns}
    if not letters or not headers.keys() >= {*letters}:
        return {}
    return {name: headers[letter] for name, letter in zip(EULER, letters, strict=True)}


def _recognize_headers(
    text: TextTable, mapped: Mapping[str, str], robot: Robot | None
) -> Iterator[_Header]:
    """Recognize each header by an option, by the robot's joint names, or by its usual
    names."""
    joint_names = (robot.command_names if robot else None) or ()
    names_of_joints = {
        _simplify(joint_name): f"q{joint}"
        for joint, joint_name in enumerate(joint_names, 1)
    }
    # If options give one header two names, the first counts.
    names_of_options = {header: name for name, header in reversed([*mapped.items()])}
    usual = {header: recognize_column(header) for header in text.columns}
    usual_names = {name for name, _ in usual.values()} | {*mapped}
    is_quaternion = {"qx", "qy", "qz"} <= usual_names and "qw" not in usual_names
    for header, (name, unit) in usual.items():
        for plain_text, plain_unit in (split_unit(header), (header, None)):
            joint = names_of_joints.get(_simplify(plain_text))
            if joint:
                name = joint
                unit = plain_unit
        if is_quaternion and _simplify(header) == "q0":
            name = "qw"
            unit = None
        unit = choose_unit(text, header, unit)
        yield _Header(header, names_of_options.get(header, name), unit)


def choose_unit(text: TextTable, header: str, unit: str | None) -> str | None:
    """Choose the unit of a header or of the row under it; refuse two different ones."""
    unit_below = text.units.get(header)
    if unit and unit_below and unit != unit_below:
        raise InputError(
            text.path,
            "header",
            f"{header!r} and {unit_below!r} in the row under it",
            f"one unit; --ignore {header!r}, or a table with one of them",
        )
    return unit or unit_below


def _refuse_count_from_zero(
    text: TextTable, mapped: Mapping[str, str], header: _Header
) -> None:
    """Refuse an unknown joint 0: an option must state which joint is the first."""
    if header.name is not None or "q1" in mapped:
        return
    joint = _JOINT.fullmatch(_simplify(split_unit(header.text)[0]))
    if joint and int(joint[2]) == 0:
        raise InputError(
            text.path,
            "header",
            f"{header.text!r}, counted from 0",
            (
                f"--column q1={header.text!r} …, each joint's, or --ignore {header.text!r}"
            ),
        )


def _duplicate_error(text: TextTable, name: str, first: str, second: str) -> InputError:
    """Make the error of two headers for one name."""
    quaternion = ""
    if name in ("q1", "q2", "q3", "q4"):
        quaternion = "; of a quaternion --column qw=NAME …"
    problem = f"both {first!r} and {second!r} for {name}"
    allowed = f"--column {name}=NAME, or --ignore NAME{quaternion}"
    return InputError(text.path, "header", problem, allowed)


def find_units(
    text: TextTable,
    columns: Mapping[str, str],
    wanted: Sequence[str],
    stated: Mapping[str, str],
    given: Mapping[str, str],
    robot: Robot | None = None,
) -> dict[str, str]:
    """Find the units of columns: from options, from headers, or the usual ones.

    Parameters
    ----------
    text : the table
    columns : headers by name
    wanted : names of the columns whose units are needed
    stated : units that headers state, by name
    given : units that options state, by name; ``angles`` and ``lengths`` for all columns
        that have no other unit
    robot : robot whose prismatic joints report lengths

    Raises
    ------
    InputError
        A column has no unit, or one of another kind.
    """
    column_units: dict[str, str] = {}
    for name in wanted:
        kinds = list_kinds(name)
        if robot and len(kinds) > 1:
            kinds = (LENGTH if robot.prismatic_commands[int(name[1:]) - 1] else ANGLE,)
        if kinds == (NONE,):
            continue
        is_length = kinds[0] == LENGTH
        unit_of_all = given.get("lengths" if is_length else "angles")
        # An option for this column precedes its header, and both precede an option for all
        # columns.
        usual_unit = _VOCABULARY["usual_units"].get(kinds[0])
        unit = given.get(name) or stated.get(name) or usual_unit or unit_of_all
        if unit is None:
            problem = f"no unit of {columns[name]!r}"
            options = "--angles rad or --angles deg"
            example = f"{name}_deg"
            if is_length:
                options = "--lengths m or --lengths mm"
                example = f"{name}_mm"
            allowed = f"{options}, or the unit in the header, such as {example}"
            raise InputError(text.path, "header", problem, allowed)
        if _scale(unit, kinds) is None:
            key = f"unit of {columns[name]!r}"
            units = itertools.chain.from_iterable(UNITS[kind] for kind in kinds)
            raise InputError(
                text.path, key, repr(unit), f"{', '.join(units)}, by --unit {name}=UNIT"
            )
        column_units[name] = unit
    return column_units


def list_rotation_columns(notation: str, names: Collection[str]) -> Sequence[str]:
    """List the names of the columns of an orientation in a notation.

    Euler angles about three different axes may be named after the axes, such as ``rx``, if
    the table has columns of these `names`; otherwise they are ``e1..e3``.
    """
    if not notation.startswith(EULER_ANGLES):
        return _NOTATIONS[notation]
    axes = notation.removeprefix(EULER_ANGLES).lower()
    by_axis = tuple(f"r{axis}" for axis in axes)
    if len(set(axes)) == 3 and set(by_axis) <= set(names):
        return by_axis
    return EULER


def find_rotation(
    text: TextTable, columns: Mapping[str, str], notation: str | None
) -> str:
    """Find the notation of the orientations of a table: the stated one, or the only one
    that fits the columns.

    `columns` are headers by name. Raises `InputError` if the notation is ambiguous.
    """
    if notation is not None:
        if notation not in _NOTATIONS and not _EULER_NOTATION.fullmatch(notation):
            raise InputError("--rotation", "", repr(notation), _ALLOWED)
        return notation
    for certain in _CERTAIN:
        if all(name in columns for name in _NOTATIONS[certain]):
            return certain
    components = [columns[name] for name in _NOTATIONS[QUATERNIONS] if name in columns]
    if components:
        raise InputError(
            text.path,
            "header",
            f"a part of a quaternion, {', '.join(components)}",
            "--column qw=NAME and such for what is missing, or --rotation none",
        )
    angles = [columns[name] for name in (*VECTOR, *EULER) if name in columns]
    if angles:
        raise InputError(
            text.path,
            "header",
            f"orientations {', '.join(angles)} of an unknown notation",
            f"--rotation vector, euler:ZYX, euler:xyz … or none: {_ALLOWED}",
        )
    return NO_ROTATION


def convert_to_rotation_vectors(
    notation: str, values: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Convert orientations in a notation other than "none" to rotation vectors.

    Parameters
    ----------
    notation : notation of the orientations
    values : (N, columns), in the order of `list_rotation_columns`; angles in rad. The
        translations of homogeneous matrices are not used.

    Returns
    -------
    vectors : (N, 3), rad.
    is_wrong : (N,) bool array, whether the length of a quaternion differs from one, or a
        matrix from a rotation, by more than rounding to four digits explains.
    """
    is_wrong = np.zeros(len(values), bool)
    if notation == "vector":
        return values, is_wrong
    if notation.startswith(EULER_ANGLES):
        rotation = Rotation.from_euler(notation.removeprefix(EULER_ANGLES), values)
    elif notation == QUATERNIONS:
        is_wrong = np.abs(np.linalg.norm(values, axis=1) - 1.0) > UNIT_LENGTH
        quaternions = np.where(is_wrong[:, None], [1.0, 0.0, 0.0, 0.0], values)
        rotation = Rotation.from_quat(quaternions, scalar_first=True)
    else:
        matrices = values.reshape(len(values), 3, -1)[:, :, :3]
        products = np.swapaxes(matrices, 1, 2) @ matrices
        is_wrong = np.abs(products - np.eye(3)).max(axis=(1, 2)) > UNIT_LENGTH
        is_wrong |= np.linalg.det(matrices) < 0.0
        rotation = Rotation.from_matrix(
            np.where(is_wrong[:, None, None], np.eye(3), matrices)
        )
    return rotation.as_rotvec(), is_wrong
