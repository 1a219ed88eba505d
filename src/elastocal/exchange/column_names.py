"""Recognize the columns of tables of other programs, and their units.

A column is recognized by its usual names, such as ``J1``, ``A1``, ``Joint 1`` or ``q1
[deg]`` for the first joint. Its unit is in brackets or behind the name (``x_mm``), in a
row under the names, or an option states it. Orientations have several notations, some of
which are recognized by their columns. Errors ask the user about what is ambiguous.
"""

import itertools
import math
import re
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import constants
from scipy.spatial.transform import Rotation

from elastocal.campaigns.tables import TextTable
from elastocal.errors import InputError, suggest_names
from elastocal.mechanics.components import WRENCH_NAMES
from elastocal.mechanics.robot import Robot

LENGTH = "length"
ANGLE = "angle"
FORCE = "force"
MOMENT = "moment"
TIME = "time"
TEMPERATURE = "temperature"
NONE = "none"
# SI values of the units, by kind of quantity.
UNITS: dict[str, dict[str, float]] = {
    LENGTH: {
        "m": 1.0,
        "mm": 1e-3,
        "cm": 1e-2,
        "um": 1e-6,
        "µm": 1e-6,
        "in": constants.inch,
    },
    ANGLE: {"rad": 1.0, "deg": math.radians(1.0), "°": math.radians(1.0), "mrad": 1e-3},
    FORCE: {"N": 1.0, "kN": 1e3, "kgf": constants.kgf, "lbf": constants.lbf},
    MOMENT: {
        "Nm": 1.0,
        "Nmm": 1e-3,
        "kNm": 1e3,
        "kgfm": constants.kgf,
        "lbfft": constants.lbf * constants.foot,
    },
    TIME: {
        "s": 1.0,
        "ms": 1e-3,
        "us": 1e-6,
        "µs": 1e-6,
        "ns": 1e-9,
        "min": 60.0,
        "h": 3600.0,
    },
    TEMPERATURE: {"C": 1.0, "°C": 1.0},
    NONE: {"": 1.0},
}
POSITION = ("x", "y", "z")
TRANSLATION = ("t14", "t24", "t34")
VECTOR = ("rx", "ry", "rz")
QUATERNION = ("qw", "qx", "qy", "qz")
EULER = ("e1", "e2", "e3")
MATRIX = tuple(f"r{i}{j}" for i in (1, 2, 3) for j in (1, 2, 3))
HOMOGENEOUS = tuple(f"t{i}{j}" for i in (1, 2, 3) for j in (1, 2, 3, 4))
NO_ROTATION = "none"
QUATERNIONS = "quaternion"
HOMOGENEOUS_MATRICES = "homogeneous"
EULER_ANGLES = "euler:"
# Columns of each notation; those that say by themselves what they are come first.
_NOTATIONS: dict[str, tuple[str, ...]] = {
    HOMOGENEOUS_MATRICES: HOMOGENEOUS,
    QUATERNIONS: QUATERNION,
    "matrix": MATRIX,
    "vector": VECTOR,
    NO_ROTATION: (),
}
_CERTAIN = (HOMOGENEOUS_MATRICES, QUATERNIONS, "matrix")
_ALLOWED = (
    "none, vector, quaternion, matrix, homogeneous, or euler: with three axes such as"
    " euler:ZYX (about axes that turn with the body; small letters, euler:xyz: about"
    " fixed ones)"
)
# Upper bound on the error of a quaternion's length and of a matrix product R' R; rounding
# to four digits causes less.
UNIT_LENGTH = 2e-3
_BRACKETS = re.compile(r"(.*?)\s*[\[(]\s*(.*?)\s*[\])]\s*")
_INDEX = re.compile(r"([^\[(]*?)\s*[\[(]\s*([0-9]+)\s*[\])](.*)", re.ASCII)
# Units that a column has if none is stated. Angles and lengths have two usual units each
# and must be stated.
_USUAL = {FORCE: "N", MOMENT: "Nm", TIME: "s", TEMPERATURE: "C"}
# How people write that a column has no unit.
_NO_UNIT = ("", "-", "1", "#", "–", "none")
_BEHIND = re.compile(r"(.+?)[_/ ]([A-Za-zµ°]+)")
# Names of joint angles. A joint has at most two digits; a larger number does not belong
# to a joint.
_JOINT = re.compile(
    r"(q|j|a|axis|joint|theta|jointangle|actualq|targetq|qactual|rax|jointpos|jointposition|jointpositions|joints)([0-9]{1,2})"
)
_APPROACH = re.compile(r"(?:approach|direction)([0-9]{1,2})")
_PLACES = (
    "p{}",
    "pos{}",
    "position{}",
    "measured{}",
    "{}meas",
    "translation{}",
    "point{}",
)
_ALSO = {
    **{axis: tuple(place.format(axis) for place in _PLACES) for axis in "xyz"},
    **{
        f"q{part}": (f"quat{part}", f"orientation{part}", f"rotation{part}")
        for part in "wxyz"
    },
    **{f"f{axis}": (f"force{axis}",) for axis in "xyz"},
    **{f"m{axis}": (f"moment{axis}", f"torque{axis}") for axis in "xyz"},
    **{
        f"r{axis}": (f"rot{axis}", angle, f"rv{axis}")
        for axis, angle in zip("xyz", ("roll", "pitch", "yaw"), strict=True)
    },
    "pose": ("poseid", "posenumber"),
    "load": ("loadid", "loadcase"),
    "repeat": ("repetition", "cycle"),
    "target": ("reflector", "smr", "marker"),
    "session": (),
    "time_s": ("time", "timestamp"),
    "temperature_c": ("temperature", "temp"),
    "u95_m": ("u95", "expandeduncertainty"),
}
_KNOWN = {
    other: name
    for name, others in _ALSO.items()
    for other in (name.replace("_", ""), *others)
}
# Euler angles are named by options alone: E1 to E3 may be external axes.
_KNOWN |= {name: name for name in (*MATRIX, *HOMOGENEOUS)}


def kind_of(name: str) -> tuple[str, ...]:
    """Kinds of quantities that a column may hold, keys of `UNITS`, by the name that
    this module gives it."""
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
    return (
        name in {*_KNOWN.values(), *EULER}
        or re.fullmatch(r"(q|approach)[1-9][0-9]?", name) is not None
    )


def has_position(names: Collection[str | None]) -> bool:
    """Whether names of columns are those of a position, by itself or in a homogeneous
    matrix."""
    return set(POSITION) <= set(names) or set(TRANSLATION) <= set(names)


def lengths_in(headers: Iterable[str]) -> list[str]:
    """List headers of lengths that belong to no position, as of a draw wire or a ball
    bar."""
    names = ("l", "length", "distance", "wirelength", "wire")
    lengths = []
    for header in headers:
        text, unit = split_unit(header)
        has_length_unit = unit in UNITS[LENGTH] and not _find_name(text)
        if has_length_unit or _simplify(text) in names:
            lengths.append(header)
    return lengths


def find_joints(names: Iterable[str]) -> list[str]:
    """List the names of joint angles among names, in the order of the joints."""
    angles = [name for name in names if re.fullmatch(r"q[0-9]+", name)]
    joints = sorted(int(name[1:]) for name in angles)
    return [f"q{joint}" for joint in joints]


def _scale(unit: str, kinds: Iterable[str]) -> float | None:
    """SI value of one unit, if it is one of some kinds."""
    plain = _simplify_unit(unit)
    return next((UNITS[kind][plain] for kind in kinds if plain in UNITS[kind]), None)


def scales_of(units: Mapping[str, str]) -> dict[str, float]:
    """SI values of the units of columns, by their names."""
    return {name: _scale(unit, kind_of(name)) or 1.0 for name, unit in units.items()}


def read_units(cells: Sequence[str]) -> list[str] | None:
    """Read a row that has only units, such as ``deg; [mm]; -``; "" stands for no unit.

    Returns None if the row has anything else.
    """
    texts = [re.sub(r"^[\[(](.*)[\])]$", r"\1", cell).strip() for cell in cells]
    units = ["" if text in _NO_UNIT else _simplify_unit(text) for text in texts]
    known_units = set(itertools.chain.from_iterable(UNITS.values()))
    return units if any(units) and known_units.issuperset(units) else None


def recognize_column(header: str) -> tuple[str | None, str | None]:
    """Name of a column and unit, each None where the header does not say it.

    A number in brackets is an index, whatever else stands there a unit.
    """
    text, unit = split_unit(header)
    name = _find_name(text)
    if name is not None and unit is None:
        return name, {"time_s": "s", "temperature_c": "C", "u95_m": "m"}.get(
            header.lower()
        )
    return name, unit


def split_unit(header: str) -> tuple[str, str | None]:
    """A header without its unit, and the unit; an index in brackets is a part of the
    name."""
    index = _INDEX.fullmatch(header)
    if index and index[1]:
        # Of a name with a number an index is one too many.
        header = f"{index[1]}{' index ' if index[1][-1].isdigit() else ''}{index[2]}{index[3]}"
    if bracketed := _BRACKETS.fullmatch(header):
        return bracketed[1], _simplify_unit(bracketed[2]) or None
    behind = _BEHIND.fullmatch(header)
    if (
        _find_name(header) is None
        and behind
        and any(_simplify_unit(behind[2]) in units for units in UNITS.values())
    ):
        name = _find_name(behind[1])
        if name is None or _scale(behind[2], kind_of(name)) is not None:
            return behind[1], _simplify_unit(behind[2])
    return header, None


def _find_name(text: str) -> str | None:
    """Name of a column that is called so, None if it is unknown."""
    plain = _simplify(text)
    for pattern, letter in ((_JOINT, "q"), (_APPROACH, "approach")):
        match = pattern.fullmatch(plain)
        if match:
            number = int(match[match.lastindex or 1])
            # If a table counts from joint 0, an option must state the first joint.
            if number:
                return f"{letter}{number}"
    return _KNOWN.get(plain)


def _simplify(text: str) -> str:
    return re.sub(r"[^a-z0-9]", "", text.lower())


def _simplify_unit(unit: str) -> str:
    return (
        re.sub(r"[ ·*.⋅]", "", unit).replace("degrees", "deg").replace("degree", "deg")
    )


@dataclass(frozen=True)
class _Header:
    """A header of a table: `text`, the column's name as this module has it, None if it
    is unknown, and the unit, None if none is stated."""

    text: str
    name: str | None
    unit: str | None


def find_columns(
    text: TextTable, mapped: Mapping[str, str], robot: Robot | None
) -> tuple[dict[str, str], dict[str, str]]:
    """Find out what the columns of a table are.

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
            found = f"no column {stated_header!r}"
            allowed = suggest_names(stated_header, list(text.columns))
            raise InputError(text.path, "header", found, allowed)
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
        if has_unit and name not in mapped and kind_of(name) == (NONE,):
            found = f"{header.text!r}, a {name} with a unit"
            allowed = (
                f"--ignore {header.text!r}, --column {name}={header.text!r} where it"
                f" numbers or names each {name}, or --column NAME=…"
            )
            raise InputError(text.path, "header", found, allowed)
        columns[name] = header.text
        if header.unit is not None:
            stated_units[name] = header.unit
    return columns, stated_units


def _recognize_headers(
    text: TextTable, mapped: Mapping[str, str], robot: Robot | None
) -> Iterator[_Header]:
    """Recognize each header: by an option, by the robot's joint names, or by what such
    a column is usually called."""
    joint_names = (robot.joint_names if robot else None) or ()
    names_of_joints = {
        _simplify(joint_name): f"q{joint}"
        for joint, joint_name in enumerate(joint_names, 1)
    }
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
    """Unit of a header, or of the row under it; refuse two different ones."""
    unit_below = text.units.get(header)
    if unit and unit_below and unit != unit_below:
        found = f"{header!r} and {unit_below!r} in the row under it"
        allowed = f"one unit; --ignore {header!r}, or a table with one of them"
        raise InputError(text.path, "header", found, allowed)
    return unit or unit_below


def _refuse_count_from_zero(
    text: TextTable, mapped: Mapping[str, str], header: _Header
) -> None:
    """Refuse an unknown joint 0: an option must state which joint is the first."""
    if header.name is not None or "q1" in mapped:
        return
    joint = _JOINT.fullmatch(_simplify(split_unit(header.text)[0]))
    if joint and int(joint[2]) == 0:
        found = f"{header.text!r}, counted from 0"
        allowed = (
            f"--column q1={header.text!r} …, each joint's, or --ignore {header.text!r}"
        )
        raise InputError(text.path, "header", found, allowed)


def _duplicate_error(text: TextTable, name: str, first: str, second: str) -> InputError:
    """Make the error of two headers for one name."""
    quaternion = ""
    if name in ("q1", "q2", "q3", "q4"):
        quaternion = "; of a quaternion --column qw=NAME …"
    found = f"both {first!r} and {second!r} for {name}"
    allowed = f"--column {name}=NAME, or --ignore NAME{quaternion}"
    return InputError(text.path, "header", found, allowed)


def find_units(
    text: TextTable,
    columns: Mapping[str, str],
    wanted: Sequence[str],
    stated: Mapping[str, str],
    given: Mapping[str, str],
    robot: Robot | None = None,
) -> dict[str, str]:
    """Units of wanted columns by their names: by options, by headers, or of what has a
    usual unit that one.

    `stated`: by headers. `given`: by options, ``angles`` and ``lengths`` for all that
    have no other. Raises `InputError`: no unit, or one of another kind.
    """
    found: dict[str, str] = {}
    for name in wanted:
        kinds = kind_of(name)
        if robot and len(kinds) > 1:
            kinds = (LENGTH if robot.chain.prismatic[int(name[1:]) - 1] else ANGLE,)
        if kinds == (NONE,):
            continue
        for_all = given.get("lengths" if kinds[0] == LENGTH else "angles")
        # Options go before headers, those for one column before those for all.
        unit = given.get(name) or stated.get(name) or _USUAL.get(kinds[0]) or for_all
        if unit is None:
            option = "--lengths mm" if kinds[0] == LENGTH else "--angles deg"
            raise InputError(
                text.path,
                "header",
                f"no unit of {columns[name]!r}",
                f"{option} or such, or --unit {name}=UNIT",
            )
        if _scale(unit, kinds) is None:
            units = itertools.chain.from_iterable(UNITS[kind] for kind in kinds)
            allowed = f"{', '.join(units)}, by --unit {name}=UNIT"
            raise InputError(
                text.path, f"unit of {columns[name]!r}", repr(unit), allowed
            )
        found[name] = unit
    return found


def columns_of_rotation(notation: str, there: Collection[str]) -> tuple[str, ...]:
    """Names of the columns of an orientation in a notation.

    `there`: columns that a table has: Euler angles about three different axes may be
    named after the axes, ``rx``, or ``e1..e3``.
    """
    if not notation.startswith(EULER_ANGLES):
        return _NOTATIONS[notation]
    axes = notation.removeprefix(EULER_ANGLES).lower()
    by_axis = tuple(f"r{axis}" for axis in axes)
    return (
        by_axis
        if len(set(axes)) == 3 and all(name in there for name in by_axis)
        else EULER
    )


def find_rotation(
    text: TextTable, columns: Mapping[str, str], notation: str | None
) -> str:
    """Notation of the orientations of a table: the one that is stated, or the one that
    the names of columns leave.

    `columns`: headers by name. Raises `InputError` where it is ambiguous.
    """
    if notation is not None:
        axes = notation.removeprefix(EULER_ANGLES)
        turns = re.fullmatch(r"[XYZ]{3}|[xyz]{3}", axes) and all(
            one != other for one, other in itertools.pairwise(axes)
        )
        if not (turns if axes != notation else notation in _NOTATIONS):
            raise InputError("--rotation", "", repr(notation), _ALLOWED)
        return notation
    for certain in _CERTAIN:
        if all(name in columns for name in _NOTATIONS[certain]):
            return certain
    if part := [columns[name] for name in QUATERNION if name in columns]:
        allowed = "--column qw=NAME and such for what is missing, or --rotation none"
        raise InputError(
            text.path, "header", f"a part of a quaternion, {', '.join(part)}", allowed
        )
    if angles := [columns[name] for name in (*VECTOR, *EULER) if name in columns]:
        allowed = f"--rotation vector, euler:ZYX, euler:xyz … or none: {_ALLOWED}"
        raise InputError(
            text.path,
            "header",
            f"orientations {', '.join(angles)} of an unknown notation",
            allowed,
        )
    return NO_ROTATION


def rotation_vectors(
    notation: str, values: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Rotation vectors of orientations in a notation that is not "none".

    `values` (N, columns): in the order of `columns_of_rotation`; angles in rad. Of
    homogeneous matrices the translations are left aside. Returns `vectors` (N, 3): rad;
    `off` (N,) of bool: whether a quaternion is not of length one or a matrix not a
    rotation, more than rounding to four digits explains.
    """
    off = np.zeros(len(values), bool)
    if notation == "vector":
        return values, off
    if notation.startswith(EULER_ANGLES):
        return Rotation.from_euler(
            notation.removeprefix(EULER_ANGLES), values
        ).as_rotvec(), off
    if notation == QUATERNIONS:
        off = np.abs(np.linalg.norm(values, axis=1) - 1.0) > UNIT_LENGTH
        safe = np.where(off[:, None], [1.0, 0.0, 0.0, 0.0], values)
        return Rotation.from_quat(safe, scalar_first=True).as_rotvec(), off
    matrices = values.reshape(len(values), 3, -1)[:, :, :3]
    off = (
        np.abs(np.swapaxes(matrices, 1, 2) @ matrices - np.eye(3)).max(axis=(1, 2))
        > UNIT_LENGTH
    )
    off |= np.linalg.det(matrices) < 0.0
    return Rotation.from_matrix(
        np.where(off[:, None, None], np.eye(3), matrices)
    ).as_rotvec(), off
