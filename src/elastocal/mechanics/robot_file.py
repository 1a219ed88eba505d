"""A robot from its file and back, with the checks that the file's schema cannot make.

The chain is in the notation of `chain`. Without ``joint_limits_deg`` a joint turns once either way; without
``compliance_urad_per_Nm`` the compliances have to be identified, or the joints count as rigid where nothing loads them. A
robot file may say what the links weigh::

    masses:
      - {link: 2, mass_kg: 190, centre_m: [0.52, 0.0, 0.03], relative_std: 0.1}
    gravity_m_s2: [0, 0, -9.80665]
    gear_ratio: [null, 171, 153, null, null, null]
    compensator: {joint: 2, kind: spring}
    payload_kg: 165

Link k is what joint k carries; link 0 is the column before joint 1. ``centre_m`` is
stated in the frame of the chain directly behind the transform ``R.(qk)`` (of link 0: in
the base frame): its origin lies on the axis of joint k, where the chain has it, and its
axes turn with the joint, so that one axis is the joint's own. With all of the chain at
zero these are base axes unless the chain has fixed rotations before. ``relative_std``
is the standard deviation of the mass over the mass, and of each component of the centre
over its distance from the origin (0.1 m at least). Gravity is given in base axes: a
robot on a wall or on a tilted foot has another.
"""

from __future__ import annotations

import math
from itertools import pairwise
from operator import attrgetter
from typing import TYPE_CHECKING

import numpy as np

from elastocal.counting import format_count
from elastocal.errors import InputError
from elastocal.mechanics.chain import format_chain, parse_chain
from elastocal.mechanics.robot import (
    STANDING,
    UNLIMITED_DEG,
    Compensator,
    Link,
    Mass,
    Robot,
    Tube,
    estimate_typical_compliance,
)

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from typing import Any

    from elastocal.mechanics.chain import Chain

# The longest serial arms of the market reach 4.7 m and their lengths, the column's
# included, sum to 7; any of them written in centimetres, inches or millimetres is
# beyond this.
LONGEST_REACH_M = 10.0
# In orbit there is still a microgravity of some 1e-5 m/s².
_LEAST_GRAVITY = 1e-6


def parse_robot(document: Mapping[str, Any], source: str = "robot") -> Robot:
    """Make a robot from the contents of its file, already validated against the robot
    schema.

    `document`: keys as in ``schemas/robot.yaml``. `source`: named in errors. Raises
    `InputError` where the chain does not parse or reaches farther than any machine, or
    a list has another length than there are joints.
    """
    chain = parse_chain(document["chain"], document.get("lengths_m", {}), source)
    reach = sum(
        abs(transform.constant)
        for transform in chain.transforms
        if transform.kind == "T"
    )
    if reach > LONGEST_REACH_M:
        key = "lengths_m" if document.get("lengths_m") else "chain"
        allowed = "lengths in metres (not millimetres) that reach"
        raise InputError(
            source,
            key,
            f"a chain that reaches {reach:.4g} m",
            f"{allowed} {LONGEST_REACH_M:g} m at most",
        )
    n = chain.coordinates
    reported = document.get("reported_joints", {})
    matrix = reported.get("matrix", np.eye(n).tolist())
    offset = reported.get("offset_deg", [0.0] * n)
    if [len(row) for row in matrix] != [n] * n or len(offset) != n:
        found = f"rows of {[len(row) for row in matrix]} and {format_count(len(offset), 'offset')}"
        raise InputError(
            source, "reported_joints", found, f"{n} rows of {n} numbers and {n} offsets"
        )
    gravity = tuple(map(float, document.get("gravity_m_s2", STANDING)))
    if math.hypot(*gravity) < _LEAST_GRAVITY:
        allowed = f"a vector in base axes of {_LEAST_GRAVITY:g} m/s² or more"
        raise InputError(source, "gravity_m_s2", str(document["gravity_m_s2"]), allowed)
    beside = (
        Compensator(**document["compensator"]) if document.get("compensator") else None
    )
    if beside and beside.joint > n:
        raise InputError(
            source, "compensator.joint", str(beside.joint), f"a joint from 1 to {n}"
        )
    springs = _of_each_joint(document, "compliance_urad_per_Nm", n, source)
    payload_kg = document.get("payload_kg")
    return Robot(
        name=document["name"],
        chain=chain,
        compliance=estimate_typical_compliance(chain, payload_kg)
        if springs is None
        else 1e-6 * np.array(springs, float),
        joint_limits=parse_joint_limits(
            document.get("joint_limits_deg"), chain, source
        ),
        links=_links(chain, document.get("links"), source),
        reported_matrix=np.array(matrix, float),
        reported_offset=np.array(offset, float) * _per_degree(chain),
        masses=_masses(document.get("masses", ()), n, source),
        gravity_m_s2=gravity,
        gear_ratio=_of_each_joint(document, "gear_ratio", n, source, "one or null"),
        compensator=beside,
        payload_kg=payload_kg,
        joint_names=_of_each_joint(document, "joint_names", n, source),
        compliance_known=springs is not None,
    )


def describe_robot(robot: Robot) -> dict[str, Any]:
    """A robot without elastic links as the contents of its file, the inverse of
    `robot_from_document`.

    Optional keys only where they say something; lengths stand in the chain as numbers.
    """
    counted_otherwise = (
        robot.reported_matrix != np.eye(robot.joints)
    ).any() or robot.reported_offset.any()
    reported = {
        "matrix": robot.reported_matrix.tolist(),
        "offset_deg": (robot.reported_offset / _per_degree(robot.chain)).tolist(),
    }
    document = {
        "name": robot.name,
        "joint_names": robot.joint_names and list(robot.joint_names),
        "chain": format_chain(robot.chain),
        "joint_limits_deg": (
            robot.joint_limits / _per_degree(robot.chain)[:, None]
        ).tolist(),
        "compliance_urad_per_Nm": (1e6 * robot.compliance).tolist()
        if robot.compliance_known
        else None,
        "reported_joints": reported if counted_otherwise else None,
        "masses": [
            vars(mass) | {"centre_m": list(mass.centre_m)} for mass in robot.masses
        ]
        or None,
        "gravity_m_s2": list(robot.gravity_m_s2)
        if robot.gravity_m_s2 != STANDING
        else None,
        "gear_ratio": robot.gear_ratio and list(robot.gear_ratio),
        "compensator": robot.compensator and dict(vars(robot.compensator)),
        "payload_kg": robot.payload_kg,
    }
    return {key: value for key, value in document.items() if value is not None}


def parse_joint_limits(
    limits_deg: Sequence[Sequence[float]] | None, chain: Chain, source: str
) -> np.ndarray:
    """Joint limits (n, 2) in rad, of prismatic joints in m; a turn either way where
    nothing is known.

    `limits_deg`: lower and upper limit of each joint; of prismatic ones in metres.
    Raises `InputError` where there are too few or too many, a lower limit is not below
    the upper one, or those of a prismatic joint lack.
    """
    if limits_deg is None and any(chain.prismatic):
        joint = chain.prismatic.index(True) + 1
        raise InputError(
            source,
            "joint_limits_deg",
            f"nothing, but T.(q{joint})",
            "[lower, upper], for a track in metres",
        )
    stated = {
        "joint_limits_deg": [UNLIMITED_DEG] * chain.coordinates
        if limits_deg is None
        else limits_deg
    }
    limits = _of_each_joint(stated, "joint_limits_deg", chain.coordinates, source) or ()
    for joint, (low, high) in enumerate(limits):
        if low >= high:
            raise InputError(
                source, f"joint_limits_deg[{joint}]", str([low, high]), "[lower, upper]"
            )
    return np.array(limits, float) * _per_degree(chain)[:, None]


def _per_degree(chain: Chain) -> np.ndarray:
    """What one degree, or of prismatic joints one metre, of a robot file is in SI
    units, ndarray (n,)."""
    return np.where(chain.prismatic, 1.0, math.radians(1.0))


def _masses(
    described: Sequence[dict[str, Any]], joints: int, source: str
) -> tuple[Mass, ...]:
    for index, entry in enumerate(described):
        if entry["link"] > joints:
            allowed = f"0 for the column, or a joint up to {joints}"
            raise InputError(
                source, f"masses[{index}].link", str(entry["link"]), allowed
            )
    found = (
        Mass(**entry | {"centre_m": tuple(map(float, entry["centre_m"]))})
        for entry in described
    )
    masses = sorted(found, key=attrgetter("link"))
    twice = next(
        (one.link for one, other in pairwise(masses) if one.link == other.link), None
    )
    if twice is not None:
        raise InputError(
            source,
            "masses",
            f"link {twice} twice",
            "each link once, with all that it carries",
        )
    return tuple(masses)


def _of_each_joint(
    document: Mapping[str, Any], key: str, joints: int, source: str, one: str = "one"
) -> tuple[Any, ...] | None:
    entries = document.get(key)
    if entries is not None and len(entries) != joints:
        raise InputError(
            source,
            key,
            format_count(len(entries), "entry", "entries"),
            f"{one} for each of the {joints} joints",
        )
    return None if entries is None else tuple(entries)


def _links(
    chain: Chain, described: Mapping[str, Any] | None, source: str
) -> tuple[Link, ...]:
    """The rigid stretches between joints, each as the tube that it is taken for."""
    if described is None:
        return ()
    odd = {
        "fixed rotations": any(
            t.kind == "R" and t.coordinate is None for t in chain.transforms
        ),
        "prismatic joints": any(chain.prismatic),
    }
    if what := next((what for what, there in odd.items() if there), ""):
        raise InputError(
            source,
            "links",
            f"a chain with {what}",
            "links on chains that turn at their joints only",
        )
    rigid = []
    vector = np.zeros(3)
    for index, transform in enumerate(chain.transforms, 1):
        vector[transform.axis] += transform.constant
        turns = transform.kind == "R"
        if (turns or index == len(chain.transforms)) and vector.any():
            rigid.append((index - turns, tuple(vector.tolist())))
            vector[:] = 0.0
    tubes = described["tubes"]
    if len(tubes) not in (1, len(rigid)):
        allowed = f"one for all links or one for each of the {len(rigid)}"
        raise InputError(
            source, "links.tubes", format_count(len(tubes), "tube"), allowed
        )
    moduli = [1e9 * described[f"{name}_modulus_GPa"] for name in ("youngs", "shear")]
    for size in tubes:
        if 2 * size["wall_m"] > size["outer_diameter_m"]:
            raise InputError(
                source,
                "links.tubes",
                f"wall_m {size['wall_m']}",
                "at most half the outer_diameter_m",
            )
    each = [
        Tube(size["outer_diameter_m"], size["wall_m"], *moduli) for size in tubes
    ] * (len(rigid) // len(tubes))
    return tuple(
        Link(*stretch, tube) for stretch, tube in zip(rigid, each, strict=True)
    )
