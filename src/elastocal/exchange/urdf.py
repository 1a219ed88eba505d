"""A URDF to the contents of a robot file."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from elastocal.errors import InputError
from elastocal.exchange.dh_table import MOST_TURNS
from elastocal.exchange.mass_deviations import OF_URDF
from elastocal.exchange.robot_text import Imported, check_imported
from elastocal.exchange.urdf_chain import chain_between
from elastocal.exchange.urdf_reading import Joint, Urdf, read_urdf
from elastocal.exchange.urdf_weights import gravity_in_base, weights_of
from elastocal.mechanics.usual_values import UNLIMITED_DEG

# Limits to a billionth of a degree, or to a nanometre.
_DECIMALS = 9
# Two turns, and rounding; the limits of a joint in degrees are farther, and few joints turn so often.
_FARTHEST_RAD, _DEG = 4.0 * math.pi + 0.01, "deg"
# An angle this close to a right one, and none, is one that was written with few digits: 1.57 and 1.5708 are.
_NEARLY_RAD, _EXACTLY_RAD = 1e-3, 1e-9


def robot_from_urdf(
    path: str | Path,
    base: str,
    tip: str,
    points: Sequence[str] = (),
    relative_std: float = OF_URDF,
    limits_in: str | None = None,
) -> Imported:
    """The robot between two links of a URDF.

    `base`, `tip`: links: the robot's base frame, and its last measuring point. `points`: links between them that become
    measuring points too. `relative_std`: how well the masses are known. `limits_in`: unit of the limits of joints that turn;
    asked for where one goes farther than joints do in rad, else rad as URDF has it. Returns joint limits of continuous joints
    are a turn either way; compliances are none, for a URDF has none. Raises `InputError`: as in `read_urdf` and
    `chain_between`; a prismatic joint without limits.
    """
    urdf, source = read_urdf(path), str(path)
    chain = chain_between(urdf, base, tip, points, source)
    weights = weights_of(urdf, chain, relative_std)
    gravity = gravity_in_base(urdf, base)
    notes = [
        f"read: {', '.join(f'q{number} from {joint.name!r}' for number, joint in enumerate(chain.joints, 1))}",
        *weights.notes,
    ]
    limits = [_limits(joint, limits_in, notes, source) for joint in chain.joints]
    if limits_in == _DEG:
        notes.append("limits read in degrees, as the option says")
    document: dict[str, Any] = {
        "name": urdf.name,
        "joint_names": [joint.name for joint in chain.joints],
        "chain": chain.notation,
        "joint_limits_deg": limits,
    }
    if gravity is not None:
        document["gravity_m_s2"] = gravity
        notes.append(f"gravity as at {base!r} where the root of the tree stands upright and the joints before it are at zero")
    if weights.masses:
        document["masses"] = weights.masses
        notes.append(f"masses are known to {100 * relative_std:g} %, by assumption: a URDF does not say")
    if few := _few_digits(urdf, [joint.child for joint in urdf.joints if joint.child in chain.links]):
        notes.append(f"nearly right angles stay as they are written, with few digits: those of {few}")
    if beside := [joint.name for joint in urdf.joints if joint.kind != "fixed" and joint.child not in chain.links]:
        notes.append(f"joints that are no part of the chain, left out: {', '.join(beside)}")
    if urdf.left_out:
        notes.append(f"not used: {', '.join(urdf.left_out)}, nor limits of effort and velocity")
    return check_imported(document, path, f"the links from {base!r} to {tip!r}", notes)


def _limits(joint: Joint, limits_in: str | None, notes: list[str], source: str) -> list[float]:
    """Degrees, of prismatic joints metres."""
    low, high = joint.lower, joint.upper
    prismatic = joint.kind == "prismatic"
    if joint.kind == "continuous" and low >= high:
        return list(UNLIMITED_DEG)
    if low >= high and prismatic:
        allowed = 'of a prismatic joint, <limit lower="..." upper="..."> in metres'
        raise InputError(source, f"joint {joint.name!r}: limit", f"{low:g} to {high:g}", allowed)
    if low >= high or (not prismatic and max(-low, high) > 2.0 * math.pi * MOST_TURNS):
        notes.append(f"joint {joint.name!r} has no limits in the URDF: a turn either way")
        return list(UNLIMITED_DEG)
    if limits_in is None and not prismatic and max(-low, high) > _FARTHEST_RAD:
        turns = max(-low, high) / (2.0 * math.pi)
        allowed = "radians; --limits deg where the file has degrees, or --limits rad where the joint does turn as often"
        raise InputError(source, f"joint {joint.name!r}: limit", f"{low:g} to {high:g}, {turns:.0f} turns", allowed)
    return [round(value if prismatic or limits_in == _DEG else math.degrees(value), _DECIMALS) for value in (low, high)]


def _few_digits(urdf: Urdf, children: Sequence[str]) -> str:
    """Joints of the chain with a rotation that is a right angle but for the digits it was written with."""
    named = []
    for joint in urdf.joints:
        if joint.child in children:
            off = np.abs(joint.origin[:3, :3] - np.round(joint.origin[:3, :3]))
            if _EXACTLY_RAD < off.max() < _NEARLY_RAD:
                named.append(joint.name)
    return ", ".join(named)
