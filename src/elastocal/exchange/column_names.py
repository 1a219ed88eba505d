"""What the columns of other people's tables are: by their names, and in which unit.

A column is recognized by what it is usually called, such as ``J1``, ``A1``, ``Joint 1`` or ``q1 [deg]`` for the first joint.
Its unit stands in brackets or behind the name (``x_mm``), or is stated by an option.
"""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING

from scipy import constants

from elastocal.mechanics.components import WRENCH_NAMES

if TYPE_CHECKING:
    from collections.abc import Iterable

LENGTH, ANGLE, FORCE, MOMENT, TIME, TEMPERATURE, NONE = "length", "angle", "force", "moment", "time", "temperature", "none"
# SI value of one of each unit, by kind.
UNITS: dict[str, dict[str, float]] = {
    LENGTH: {"m": 1.0, "mm": 1e-3, "cm": 1e-2, "um": 1e-6, "µm": 1e-6, "in": constants.inch},
    ANGLE: {"rad": 1.0, "deg": math.radians(1.0), "°": math.radians(1.0), "mrad": 1e-3},
    FORCE: {"N": 1.0, "kN": 1e3, "kgf": constants.kgf, "lbf": constants.lbf},
    MOMENT: {"Nm": 1.0, "Nmm": 1e-3, "kNm": 1e3, "kgfm": constants.kgf, "lbfft": constants.lbf * constants.foot},
    TIME: {"s": 1.0, "ms": 1e-3, "min": 60.0, "h": 3600.0},
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
_BEHIND = re.compile(r"(.+?)[_/ ]([A-Za-zµ°]+)")
# No arm has a hundred joints, and a table is looked through for each up to the last that it names.
_JOINT = re.compile(r"(?:q|j|a|axis|joint|theta|jointangle|actualq)([0-9]{1,2})")
_APPROACH = re.compile(r"(?:approach|direction)([0-9]{1,2})")
_ALSO = {
    "x": ("px", "posx", "positionx", "measuredx", "xmeas"),
    "y": ("py", "posy", "positiony", "measuredy", "ymeas"),
    "z": ("pz", "posz", "positionz", "measuredz", "zmeas"),
    "rx": ("rotx", "roll", "rvx"),
    "ry": ("roty", "pitch", "rvy"),
    "rz": ("rotz", "yaw", "rvz"),
    "qw": ("quatw",),
    "qx": ("quatx",),
    "qy": ("quaty",),
    "qz": ("quatz",),
    "fx": ("forcex",),
    "fy": ("forcey",),
    "fz": ("forcez",),
    "mx": ("momentx", "torquex"),
    "my": ("momenty", "torquey"),
    "mz": ("momentz", "torquez"),
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


def kind_of(name: str) -> tuple[str, ...]:
    """Kinds of quantities that a column may hold.

    Parameters
    ----------
    name : str
        As this module calls columns.

    Returns
    -------
    tuple of str
        Keys of `UNITS`.
    """
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


def unit_scale(name: str, unit: str) -> float | None:
    """SI value of one unit of a column; None where it is none of its units."""
    plain = _plain_unit(unit)
    return next((UNITS[kind][plain] for kind in kind_of(name) if plain in UNITS[kind]), None)


def units_of(name: str) -> list[str]:
    """Units in which a column may be."""
    return [unit for kind in kind_of(name) for unit in UNITS[kind]]


def recognized(header: str) -> tuple[str | None, str | None]:
    """What a column is, by its header.

    Parameters
    ----------
    header : str

    Returns
    -------
    name : str or None
        As this module calls columns, None where the header is not known.
    unit : str or None
        As it stands in the header, None where none does.
    """
    bracketed = _BRACKETS.fullmatch(header)
    if bracketed:
        name = _named(bracketed[1])
        return name, _plain_unit(bracketed[2]) or None
    name = _named(header)
    if name is not None:
        return name, {"time_s": "s", "temperature_c": "C", "u95_m": "m"}.get(header.lower())
    behind = _BEHIND.fullmatch(header)
    if behind and (name := _named(behind[1])) is not None and unit_scale(name, behind[2]) is not None:
        return name, _plain_unit(behind[2])
    return None, None


def joints_in(names: Iterable[str]) -> list[str]:
    """Names of joint angles among names, from q1 on."""
    numbers = sorted(int(name[1:]) for name in names if re.fullmatch(r"q[0-9]+", name))
    return [f"q{number}" for number in numbers]


def _named(text: str) -> str | None:
    plain = re.sub(r"[^a-z0-9]", "", text.lower())
    for pattern, letter in ((_JOINT, "q"), (_APPROACH, "approach")):
        if match := pattern.fullmatch(plain):
            # Joint 0 is somebody's first: whose, an option has to say.
            return f"{letter}{int(match[1])}" if int(match[1]) else None
    return _KNOWN.get(plain)


def _plain_unit(unit: str) -> str:
    return re.sub(r"[ ·*.⋅]", "", unit).replace("degrees", "deg").replace("degree", "deg")
