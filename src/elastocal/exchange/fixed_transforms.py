"""Fixed transforms, as matrices and as words of the chain notation, see `mechanics.chain`.

A rigid displacement becomes ``Tx Ty Tz Rz Ry Rx``, the rotation by yaw, pitch and roll; what is zero is left out.
"""

import math
from collections.abc import Sequence

import numpy as np

# Picometres, and as many degrees: a chain of any length keeps to far less than a nanometre, and cos(90 deg) is no length.
_DECIMALS = 12


def displacement_words(transform: np.ndarray) -> list[str]:
    """A homogeneous transform (4, 4) in words."""
    amounts = dict(zip(("Tx", "Ty", "Tz"), transform[:3, 3], strict=True))
    amounts |= dict(zip(("Rz", "Ry", "Rx"), yaw_pitch_roll(transform[:3, :3]), strict=True))
    return [text for name, amount in amounts.items() if (text := word(name, amount))]


def word(name: str, amount: float) -> str:
    """``Tx(0.5)`` of m, ``Rx(90deg)`` of rad; empty for nothing."""
    turns = name.startswith("R")
    amount = round(math.degrees(amount) if turns else amount, _DECIMALS)
    text = np.format_float_positional(abs(amount), trim="-")
    return f"{name}({'-' if amount < 0 else ''}{text}{'deg' if turns else ''})" if amount else ""


def express_axis(axis: np.ndarray) -> tuple[list[str], str, str, list[str], np.ndarray]:
    """A joint's axis (3,), not zero, as one of the chain's, between a fixed rotation and its inverse where it is oblique.

    Returns `before`: words of the rotation that turns z into the axis, empty for x, y and z; `letter`, `sign`: of the axis
    then, and "-" or ""; `after`: words of the rotation back; the fixed rotation before, as a matrix (3, 3).
    """
    unit = np.asarray(axis, float) / np.linalg.norm(axis)
    along = int(np.argmax(np.abs(unit)))
    if np.abs(np.delete(unit, along)).max() < 10.0**-_DECIMALS:
        return [], "xyz"[along], "-" if unit[along] < 0 else "", [], np.eye(3)
    turns = [("Rz", math.atan2(unit[1], unit[0])), ("Ry", math.atan2(math.hypot(unit[0], unit[1]), unit[2]))]
    before = [text for name, angle in turns if (text := word(name, angle))]
    after = [text for name, angle in reversed(turns) if (text := word(name, -angle))]
    angles = [math.radians(round(math.degrees(angle), _DECIMALS)) for _, angle in turns]
    return before, "z", "", after, rotation_about("z", angles[0]) @ rotation_about("y", angles[1])


def yaw_pitch_roll(rotation: np.ndarray) -> tuple[float, float, float]:
    """Angles of R (3, 3) = Rz(yaw) Ry(pitch) Rx(roll), rad.

    Near a pitch of 90 deg yaw and roll are not separate; the roll is read of what the yaw leaves, so that the product is right.
    """
    level = math.hypot(rotation[0, 0], rotation[1, 0])
    yaw = math.atan2(rotation[1, 0], rotation[0, 0]) if level > 10.0**-_DECIMALS else 0.0
    rest = rotation_about("z", -yaw) @ rotation
    return yaw, math.atan2(-rotation[2, 0], level), math.atan2(-rest[1, 2], rest[1, 1])


def rotation_about(letter: str, angle_rad: float) -> np.ndarray:
    """Rotation matrix about x, y or z, ndarray (3, 3)."""
    c, s = math.cos(angle_rad), math.sin(angle_rad)
    first, second = {"x": (1, 2), "y": (2, 0), "z": (0, 1)}[letter]
    turn = np.eye(3)
    turn[first, first] = turn[second, second] = c
    turn[first, second], turn[second, first] = -s, s
    return turn


def elementary(kind: str, axis: int, amount: float) -> np.ndarray:
    """Shift (``T``, m) along or turn (``R``, rad) about an axis, 0 to 2, ndarray (4, 4)."""
    if kind == "R":
        return homogeneous(rotation_about("xyz"[axis], amount))
    return homogeneous(np.eye(3), amount * np.eye(3)[axis])


def homogeneous(rotation: np.ndarray, shift: Sequence[float] | np.ndarray = (0.0, 0.0, 0.0)) -> np.ndarray:
    """A turn (3, 3) and a shift (3,) as one, ndarray (4, 4)."""
    found = np.eye(4)
    found[:3, :3], found[:3, 3] = rotation, shift
    return found


def origin_transform(xyz: Sequence[float], rpy: Sequence[float]) -> np.ndarray:
    """Shift (m), then turn by roll, pitch and yaw (rad) as the origin of a URDF has them, ndarray (4, 4)."""
    roll, pitch, yaw = rpy
    return homogeneous(rotation_about("z", yaw) @ rotation_about("y", pitch) @ rotation_about("x", roll), xyz)
