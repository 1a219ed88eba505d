"""What the columns of other people's tables are: by their names, and in which unit; what is ambiguous is asked for.

A column is recognized by what it is usually called, such as ``J1``, ``A1``, ``Joint 1`` or ``q1 [deg]`` for the first joint, or
by the end of a topic, ``/tcp/pose/position/x``. Its unit stands in brackets or behind the name (``x_mm``), in a row under the
names, or is stated by an option. Orientations come in several notations, of which some say by themselves what they are.
"""

import itertools
import math
import re
from collections.abc import Collection, Iterable, Mapping, Sequence

import numpy as np
from scipy import constants
from scipy.spatial.transform import Rotation

from elastocal.errors import InputError, closest_first
from elastocal.exchange.csv_dialect import TextTable
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
VECTOR, QUATERNION, EULER = ("rx", "ry", "rz"), ("qw", "qx", "qy", "qz"), ("e1", "e2", "e3")
MATRIX = tuple(f"r{i}{j}" for i in (1, 2, 3) for j in (1, 2, 3))
HOMOGENEOUS = tuple(f"t{i}{j}" for i in (1, 2, 3) for j in (1, 2, 3, 4))
NO_ROTATION, QUATERNIONS, HOMOGENEOUS_MATRICES, EULER_ANGLES = "none", "quaternion", "homogeneous", "euler:"
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
# Columns that a table may have in two meanings: external axes E1 to E3 beside an orientation.
_OTHER_ANGLES = (("A", "B", "C"), ("W", "P", "R"), ("O", "A", "T"))
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
    """Name of a column and unit, each None where the header does not say it.

    A number in brackets is an index, whatever else stands there a unit. Of a topic such as ``/tcp/pose/position/x`` or
    ``field.pose.position.x`` the last two names count, or the last but one before ``position``.
    """
    text, unit = split_unit(header)
    name = _find_name(text)
    if name is not None and unit is None:
        return name, {"time_s": "s", "temperature_c": "C", "u95_m": "m"}.get(header.lower())
    return name, unit


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
    for plain in _names_in(text):
        for pattern, letter in ((_JOINT, "q"), (_APPROACH, "approach")):
            # Joint 0 is somebody's first: whose, an option or the other columns have to say.
            if (match := pattern.fullmatch(plain)) and (number := int(match[match.lastindex or 1])):
                return f"{letter}{number}"
        if plain in _KNOWN:
            return _KNOWN[plain]
    return None


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


def find_columns(
    text: TextTable, mapped: Mapping[str, str], robot: Robot | None
) -> tuple[dict[str, str], dict[str, str], list[str]]:
    """Headers by name, those of the options first, the units that headers state, and notes."""
    for header in mapped.values():
        if header not in text.columns:
            raise InputError(text.path, "header", f"no column {header!r}", closest_first(header, list(text.columns)))
    guesses = {header: recognize_column(header) for header in text.columns}
    certain: set[str] = set()
    for joint, called in enumerate((robot and robot.joint_names) or (), 1):
        for header in text.columns:
            for plain, unit in ((header, None), split_unit(header)):
                if header not in certain and _simplify(called) in _names_in(plain):
                    guesses[header] = (f"q{joint}", unit)
                    certain.add(header)
    for header, (name, unit) in guesses.items():
        below = text.units.get(header)
        if unit and below and unit != below:
            allowed = f"one unit; --ignore {header!r}, or a table with one of them"
            raise InputError(text.path, "header", f"{header!r} and {below!r} in the row under it", allowed)
        guesses[header] = (name, unit or below)
    parts = {name: header for header, (name, _) in guesses.items() if name in QUATERNION}
    if parts.keys() == {"qx", "qy", "qz"} and "qw" not in mapped:
        # With the other three parts of a quaternion q0 has length 1.
        for header in text.columns:
            is_free = _simplify(header) == "q0" and header not in mapped.values()
            if is_free and _have_unit_length(text, [header, *parts.values()]):
                guesses[header] = ("qw", None)
                certain.add(header)
    free = [header for header in text.columns if header not in certain and guesses[header][0] not in mapped]
    joints, notes = _find_counted_joints(text, free, {*mapped.values()})
    guesses |= {header: (name, guesses[header][1]) for header, name in joints.items()}
    found, stated = dict(mapped), dict[str, str]()
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


def _find_counted_joints(text: TextTable, headers: Sequence[str], mapped: set[str]) -> tuple[dict[str, str], list[str]]:
    """Names of joints that headers count from 0, and notes; what may be a quaternion, or counts in two ways, is asked for."""
    families: dict[str, dict[int, str]] = {}
    for header in headers:
        matches = (_JOINT.fullmatch(name) for name in _names_in(split_unit(header)[0]))
        if match := next(filter(None, matches), None):
            families.setdefault(match[1], {}).setdefault(int(match[2]), header)
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
            return {header: f"q{number + 1}" for number, header in members.items()}, [note]
    return {}, []


def _have_unit_length(text: TextTable, headers: Sequence[str]) -> bool:
    rows = [[plain_number(cell) for cell in cells] for cells in zip(*(text.columns[header] for header in headers), strict=True)]
    numbers = np.array([row for row in rows if None not in row], float)
    return len(numbers) > 0 and bool((np.abs(np.linalg.norm(numbers, axis=1) - 1.0) <= UNIT_LENGTH).all())


def columns_of_rotation(notation: str, there: Collection[str]) -> tuple[str, ...]:
    """Names of the columns of an orientation in a notation.

    `there`: columns that a table has: Euler angles about three different axes may be named after the axes, ``rx``, or
    ``e1..e3``.
    """
    if not notation.startswith(EULER_ANGLES):
        return _NOTATIONS[notation]
    axes = notation.removeprefix(EULER_ANGLES).lower()
    by_axis = tuple(f"r{axis}" for axis in axes)
    return by_axis if len(set(axes)) == 3 and all(name in there for name in by_axis) else EULER


def find_rotation(text: TextTable, columns: Mapping[str, str], mapped: Mapping[str, str], notation: str | None) -> str:
    """Notation of the orientations of a table: the one that is stated, or the one that the names of columns leave.

    `columns`: headers by name. `mapped`: those of them that options state. Raises `InputError` where it is ambiguous.
    """
    if notation is not None:
        axes = notation.removeprefix(EULER_ANGLES)
        turns = re.fullmatch(r"[XYZ]{3}|[xyz]{3}", axes) and all(one != other for one, other in itertools.pairwise(axes))
        if not (turns if axes != notation else notation in _NOTATIONS):
            raise InputError("--rotation", "", repr(notation), _ALLOWED)
        if columns_of_rotation(notation, columns) == EULER:
            _check_external_axes(text, columns, mapped)
        return notation
    for certain in _CERTAIN:
        if all(name in columns for name in _NOTATIONS[certain]):
            return certain
    if part := [columns[name] for name in QUATERNION if name in columns]:
        allowed = "--column qw=NAME and such for what is missing, or --rotation none"
        raise InputError(text.path, "header", f"a part of a quaternion, {', '.join(part)}", allowed)
    if angles := [columns[name] for name in (*VECTOR, *EULER) if name in columns]:
        allowed = f"--rotation vector, euler:ZYX, euler:xyz … or none: {_ALLOWED}"
        raise InputError(text.path, "header", f"orientations {', '.join(angles)} of an unknown notation", allowed)
    return NO_ROTATION


def _check_external_axes(text: TextTable, columns: Mapping[str, str], mapped: Mapping[str, str]) -> None:
    """Ask where angles ``E1`` to ``E3`` may be external axes, as other columns look like the orientation."""
    plain = {re.split(r"[\[(]", header)[0].strip().upper(): header for header in text.columns}
    guessed = [columns[name] for name in EULER if name in columns and name not in mapped]
    others = [[plain[letter] for letter in letters] for letters in _OTHER_ANGLES if plain.keys() >= {*letters}]
    if guessed and (others or plain.keys() & {"E4", "E5", "E6"}):
        other_names = others[0] if others else ["NAME", "NAME", "NAME"]
        allowed = " ".join(f"--column {name}={header!r}" for name, header in zip(EULER, other_names, strict=True))
        own = " or ".join([f"{', '.join(guessed)} (external axes?)", *(", ".join(each) for each in others)])
        raise InputError(text.path, "header", f"orientations in {own}", f"{allowed}, or the same with {', '.join(guessed)}")


def rotation_vectors(notation: str, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rotation vectors of orientations in a notation that is not "none".

    `values` (N, columns): in the order of `columns_of_rotation`; angles in rad. Of homogeneous matrices the translations are
    left aside. Returns `vectors` (N, 3): rad; `off` (N,) of bool: whether a quaternion is not of length one or a matrix not a
    rotation, more than rounding to four digits explains.
    """
    off = np.zeros(len(values), bool)
    if notation == "vector":
        return values, off
    if notation.startswith(EULER_ANGLES):
        return Rotation.from_euler(notation.removeprefix(EULER_ANGLES), values).as_rotvec(), off
    if notation == QUATERNIONS:
        off = np.abs(np.linalg.norm(values, axis=1) - 1.0) > UNIT_LENGTH
        safe = np.where(off[:, None], [1.0, 0.0, 0.0, 0.0], values)
        return Rotation.from_quat(safe, scalar_first=True).as_rotvec(), off
    matrices = values.reshape(len(values), 3, -1)[:, :, :3]
    off = np.abs(np.swapaxes(matrices, 1, 2) @ matrices - np.eye(3)).max(axis=(1, 2)) > UNIT_LENGTH
    off |= np.linalg.det(matrices) < 0.0
    return Rotation.from_matrix(np.where(off[:, None, None], np.eye(3), matrices)).as_rotvec(), off
