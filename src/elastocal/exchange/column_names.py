"""What the columns of other people's tables are: by their names, and in which unit.

A column is recognized by what it is usually called, such as ``J1``, ``A1``, ``Joint 1`` or ``q1 [deg]`` for the first joint.
Its unit stands in brackets or behind the name (``x_mm``), or is stated by an option.
"""

import math
import re
from collections.abc import Iterable, Sequence

from scipy import constants

from elastocal.mechanics.components import WRENCH_NAMES

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
# Of what has a usual unit; angles and lengths have two each and must be stated.
USUAL = {FORCE: "N", MOMENT: "Nm", TIME: "s", TEMPERATURE: "C", NONE: ""}

POSITION = ("x", "y", "z")
VECTOR = ("rx", "ry", "rz")
QUATERNION = ("qw", "qx", "qy", "qz")
EULER = ("e1", "e2", "e3")
MATRIX = tuple(f"r{i}{j}" for i in (1, 2, 3) for j in (1, 2, 3))
HOMOGENEOUS = tuple(f"t{i}{j}" for i in (1, 2, 3) for j in (1, 2, 3, 4))
COVARIATES = ("time_s", "temperature_c", "u95_m")

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
    "rx": ("rotx", "roll", "rvx"),
    "ry": ("roty", "pitch", "rvy"),
    "rz": ("rotz", "yaw", "rvz"),
    "pose": ("poseid", "posenumber", "configuration", "config"),
    "load": ("loadid", "loadcase"),
    "repeat": ("repetition", "cycle"),
    "target": ("reflector", "smr", "marker"),
    "session": (),
    "time_s": ("time", "timestamp"),
    "temperature_c": ("temperature", "temp"),
    "u95_m": ("u95", "expandeduncertainty"),
}
# Last but one names of topics that hold angles by their number.
_ANGLES = ("position", "positions", "jointstates", "joints", "jointpositions")
_KNOWN = {other: name for name, others in _ALSO.items() for other in (name.replace("_", ""), *others)}
_KNOWN |= {name: name for name in (*EULER, *MATRIX, *HOMOGENEOUS)}


def kind_of(name: str) -> tuple[str, ...]:
    """Kinds of quantities that a column may hold, keys of `UNITS`, by the name that this module gives it."""
    if re.fullmatch(r"q[0-9]+", name):
        # A prismatic joint reports a length.
        return ANGLE, LENGTH
    if name in (*POSITION, "t14", "t24", "t34", "u95_m"):
        return (LENGTH,)
    if name in (*VECTOR, *EULER):
        return (ANGLE,)
    if name in WRENCH_NAMES:
        return (FORCE,) if name.startswith("f") else (MOMENT,)
    return ({"time_s": TIME, "temperature_c": TEMPERATURE}.get(name, NONE),)


def is_name(name: str) -> bool:
    """Whether a column of that name can be imported."""
    return name in _ALSO or name in _KNOWN.values() or re.fullmatch(r"(q|approach)[1-9][0-9]?", name) is not None


def unit_scale(unit: str, kinds: Iterable[str]) -> float | None:
    """SI value of one unit, if it is one of some kinds."""
    plain = _simplify_unit(unit)
    return next((UNITS[kind][plain] for kind in kinds if plain in UNITS[kind]), None)


def units_of(kinds: Iterable[str]) -> list[str]:
    """Units of some kinds."""
    return [unit for kind in kinds for unit in UNITS[kind]]


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


def ordinal_of_joint(header: str) -> tuple[str, int] | None:
    """What a header calls joints and the number of this one, which may be counted from 0; None where it is no joint angle."""
    matches = (_JOINT.fullmatch(name) for name in _names_in(split_unit(header)[0]))
    return next(((match[1], int(match[2])) for match in matches if match), None)


def unit_of_joint(header: str, joint: str) -> tuple[bool, str | None]:
    """Whether a column has the name of a joint (alone, with a unit, or as a topic has it), and the unit."""
    if _simplify(joint) in _names_in(header):
        return True, None
    text, unit = split_unit(header)
    return _simplify(joint) in _names_in(text), unit


def is_unit_of_none(name: str, unit: str | None) -> bool:
    """Whether a column that counts or names something has a unit in its header all the same, as ``Load [kg]`` has."""
    return unit not in (None, *_NO_UNIT) and kind_of(name) == (NONE,)


def read_units(cells: Sequence[str]) -> list[str] | None:
    """Units of a row that has nothing else, such as ``deg; [mm]; -``, "" for none; None where it has anything else."""
    bare = [re.sub(r"^[\[(](.*)[\])]$", r"\1", cell).strip() for cell in cells]
    units = ["" if unit in _NO_UNIT else _simplify_unit(unit) for unit in bare]
    known = {unit for of_kind in UNITS.values() for unit in of_kind}
    return units if any(units) and known.issuperset(units) else None


def find_joints(names: Iterable[str]) -> list[str]:
    """Names of joint angles among names, from q1 on."""
    numbers = sorted(int(name[1:]) for name in names if re.fullmatch(r"q[0-9]+", name))
    return [f"q{number}" for number in numbers]


def recognize_plain_header(text: str) -> str | None:
    """What a header without a unit is by all of it; None where it is not known, or the end of a topic."""
    return _look_up_name(_simplify(text))


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
    return next((name for plain in _names_in(text) if (name := _look_up_name(plain)) is not None), None)


def _names_in(text: str) -> list[str]:
    """What a header may be called: the whole of it, and of a topic its end."""
    parts = [plain for part in re.split(r"[/.]", text) if (plain := _simplify(part))]
    if len(parts) < 2:
        return [_simplify(text)]
    if parts[-1] in ("position", "pos"):
        return [_simplify(text), parts[-2]]
    return [
        _simplify(text),
        parts[-2] + parts[-1],
        *([parts[-1]] if _JOINT.fullmatch(parts[-1]) and parts[-2] in _ANGLES else []),
    ]


def _look_up_name(plain: str) -> str | None:
    for pattern, letter in ((_JOINT, "q"), (_APPROACH, "approach")):
        if match := pattern.fullmatch(plain):
            # Joint 0 is somebody's first: whose, an option or the other columns have to say.
            number = int(match[match.lastindex or 1])
            return f"{letter}{number}" if number else None
    return _KNOWN.get(plain)


def _simplify(text: str) -> str:
    return re.sub(r"[^a-z0-9]", "", text.lower())


def _simplify_unit(unit: str) -> str:
    return re.sub(r"[ ·*.⋅]", "", unit).replace("degrees", "deg").replace("degree", "deg")
