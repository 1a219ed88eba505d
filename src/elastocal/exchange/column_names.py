"""What the columns of other people's tables are: by their names, and in which unit;
what is ambiguous is asked for.

A column is recognized by what it is usually called, such as ``J1``, ``A1``, ``Joint 1``
or ``q1 [deg]`` for the first joint. Its unit stands in brackets or behind the name
(``x_mm``), in a row under the names, or is stated by an option. Orientations come in
several notations, of which some say by themselves what they are.
"""

import itertools
import math
import re
from collections.abc import Collection, Iterable, Mapping, Sequence

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
# SI value of one of each unit, by kind.
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
    "none, vector, quaternion, matrix, homogeneous, or euler: with three axes such as euler:ZYX (about axes that turn with the "
    "body; small letters, euler:xyz: about fixed ones)"
)
# Rounded to four digits, a quaternion's length and a matrix' columns are off by less.
UNIT_LENGTH = 2e-3
_BRACKETS = re.compile(r"(.*?)\s*[\[(]\s*(.*?)\s*[\])]\s*")
_INDEX = re.compile(r"([^\[(]*?)\s*[\[(]\s*([0-9]+)\s*[\])](.*)", re.ASCII)
# Of what has a usual unit; angles and lengths have two each and must be stated.
_USUAL = {FORCE: "N", MOMENT: "Nm", TIME: "s", TEMPERATURE: "C"}
# What has no unit, as people write it.
_NO_UNIT = ("", "-", "1", "#", "–", "none")
_BEHIND = re.compile(r"(.+?)[_/ ]([A-Za-zµ°]+)")
# No arm has a hundred joints, and a table is looked through for each up to the last
# that it names.
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
    """Headers of lengths that are none of a position, as of a draw wire or a ball
    bar."""
    parts = [(header, *split_unit(header)) for header in headers]
    called = ("l", "length", "distance", "wirelength", "wire")
    return [
        h
        for h, text, unit in parts
        if (unit in UNITS[LENGTH] and not _find_name(text)) or _simplify(text) in called
    ]


def find_joints(names: Iterable[str]) -> list[str]:
    """Names of joint angles among names, from q1 on."""
    return [
        f"q{number}"
        for number in sorted(
            int(name[1:]) for name in names if re.fullmatch(r"q[0-9]+", name)
        )
    ]


def _scale(unit: str, kinds: Iterable[str]) -> float | None:
    """SI value of one unit, if it is one of some kinds."""
    plain = _simplify_unit(unit)
    return next((UNITS[kind][plain] for kind in kinds if plain in UNITS[kind]), None)


def scales_of(units: Mapping[str, str]) -> dict[str, float]:
    """SI values of the units of columns, by their names."""
    return {name: _scale(unit, kind_of(name)) or 1.0 for name, unit in units.items()}


def read_units(cells: Sequence[str]) -> list[str] | None:
    """Units of a row that has nothing else, such as ``deg; [mm]; -``, "" for none; None
    where it has anything else."""
    bare = [re.sub(r"^[\[(](.*)[\])]$", r"\1", cell).strip() for cell in cells]
    units = ["" if unit in _NO_UNIT else _simplify_unit(unit) for unit in bare]
    known = {unit for of_kind in UNITS.values() for unit in of_kind}
    return units if any(units) and known.issuperset(units) else None


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
    plain = _simplify(text)
    for pattern, letter in ((_JOINT, "q"), (_APPROACH, "approach")):
        # Joint 0 is somebody's first: whose, an option has to say.
        if (match := pattern.fullmatch(plain)) and (
            number := int(match[match.lastindex or 1])
        ):
            return f"{letter}{number}"
    return _KNOWN.get(plain)


def _simplify(text: str) -> str:
    return re.sub(r"[^a-z0-9]", "", text.lower())


def _simplify_unit(unit: str) -> str:
    return (
        re.sub(r"[ ·*.⋅]", "", unit).replace("degrees", "deg").replace("degree", "deg")
    )


def find_columns(
    text: TextTable, mapped: Mapping[str, str], robot: Robot | None
) -> tuple[dict[str, str], dict[str, str]]:
    """Headers by name, those of the options first, and the units that headers and the
    row under them state, by name."""
    for header in mapped.values():
        if header not in text.columns:
            raise InputError(
                text.path,
                "header",
                f"no column {header!r}",
                suggest_names(header, list(text.columns)),
            )
    of_joints = {
        _simplify(called): f"q{joint}"
        for joint, called in enumerate((robot and robot.joint_names) or (), 1)
    }
    guesses = {header: recognize_column(header) for header in text.columns}
    parts = {name for name, _ in guesses.values()} | {*mapped}
    found = dict(mapped)
    stated = dict[str, str]()
    for header, (guess, unit) in guesses.items():
        for plain, beside in (split_unit(header), (header, None)):
            if name := of_joints.get(_simplify(plain)):
                guess = name
                unit = beside
        if (
            _simplify(header) == "q0"
            and {"qx", "qy", "qz"} <= parts
            and "qw" not in parts
        ):
            guess = "qw"
            unit = None
        below = text.units.get(header)
        if unit and below and unit != below:
            allowed = f"one unit; --ignore {header!r}, or a table with one of them"
            raise InputError(
                text.path,
                "header",
                f"{header!r} and {below!r} in the row under it",
                allowed,
            )
        unit = unit or below
        meant = next((name for name, named in mapped.items() if named == header), guess)
        counted = _JOINT.fullmatch(_simplify(split_unit(header)[0]))
        if meant is None and counted and int(counted[2]) == 0 and "q1" not in mapped:
            allowed = f"--column q1={header!r} …, each joint's, or --ignore {header!r}"
            raise InputError(
                text.path, "header", f"{header!r}, counted from 0", allowed
            )
        if meant is None or mapped.get(meant, header) != header:
            continue
        if found.get(meant, header) != header:
            quaternion = (
                "; of a quaternion --column qw=NAME …"
                if meant in ("q1", "q2", "q3", "q4")
                else ""
            )
            allowed = f"--column {meant}=NAME, or --ignore NAME{quaternion}"
            raise InputError(
                text.path,
                "header",
                f"both {found[meant]!r} and {header!r} for {meant}",
                allowed,
            )
        if (
            meant not in mapped
            and unit not in (None, *_NO_UNIT)
            and kind_of(meant) == (NONE,)
        ):
            allowed = f"--ignore {header!r}, --column {meant}={header!r} where it numbers or names each {meant}, or --column NAME=…"
            raise InputError(
                text.path, "header", f"{header!r}, a {meant} with a unit", allowed
            )
        found[meant] = header
        if unit is not None:
            stated[meant] = unit
    return found, stated


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
            allowed = f"{', '.join(unit for kind in kinds for unit in UNITS[kind])}, by --unit {name}=UNIT"
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
