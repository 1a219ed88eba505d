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

Link k is what joint k carries; link 0 is the column before joint 1. ``centre_m`` is stated in the frame of the chain directly
behind the transform ``R.(qk)`` (of link 0: in the base frame): its origin lies on the axis of joint k, where the chain has it,
and its axes turn with the joint, so that one axis is the joint's own. With all of the chain at zero these are base axes unless
the chain has fixed rotations before. ``relative_std`` is the standard deviation of the mass over the mass, and of each
component of the centre over its distance from the origin (0.1 m at least). Gravity is given in base axes: a robot on a wall or
on a tilted foot has another.
"""

from __future__ import annotations

import math
from itertools import pairwise
from operator import attrgetter
from typing import TYPE_CHECKING

import numpy as np

from elastocal.counting import counted
from elastocal.errors import InputError
from elastocal.mechanics.chain import notation, parse_chain, stretches
from elastocal.mechanics.robot import STANDING, Compensator, Link, Mass, Robot, Tube
from elastocal.mechanics.usual_values import UNLIMITED_DEG, usual_compliance

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from typing import Any

    from elastocal.mechanics.chain import Chain

# The longest serial arms of the market reach 4.7 m and their lengths, the column's included, sum to 7; any of them written in
# centimetres, inches or millimetres is beyond this.
LONGEST_REACH_M = 10.0
# In orbit there is still a microgravity of some 1e-5 m/s².
_LEAST_GRAVITY = 1e-6


def robot_from_document(document: Mapping[str, Any], source: str = "robot") -> Robot:
    """Make a robot from the contents of its file, already validated against the robot schema.

    `document`: keys as in ``schemas/robot.yaml``. `source`: named in errors. Raises `InputError` where the chain does not parse
    or reaches farther than any machine, or a list has another length than there are joints.
    """
    chain = parse_chain(document["chain"], document.get("lengths_m", {}), source)
    _check_reach(chain, "lengths_m" if document.get("lengths_m") else "chain", source)
    n = chain.coordinates
    reported = document.get("reported_joints", {})
    matrix = reported.get("matrix", np.eye(n).tolist())
    offset = reported.get("offset_deg", [0.0] * n)
    if [len(row) for row in matrix] != [n] * n or len(offset) != n:
        found = f"rows of {[len(row) for row in matrix]} and {counted(len(offset), 'offset')}"
        raise InputError(source, "reported_joints", found, f"{n} rows of {n} numbers and {n} offsets")
    return Robot(
        name=document["name"],
        chain=chain,
        compliance=_compliance(document, chain, source),
        joint_limits=joint_limits(document.get("joint_limits_deg"), chain, source),
        links=_links(chain, document.get("links"), source),
        reported_matrix=np.array(matrix, float),
        reported_offset=np.array(offset, float) * _per_degree(chain),
        masses=_masses(document.get("masses", ()), n, source),
        gravity_m_s2=_gravity(document.get("gravity_m_s2", STANDING), source),
        gear_ratio=_of_each_joint(document, "gear_ratio", n, source, "one or null"),
        compensator=_compensator(document.get("compensator"), n, source),
        payload_kg=document.get("payload_kg"),
        joint_names=_of_each_joint(document, "joint_names", n, source, "one"),
        compliance_known="compliance_urad_per_Nm" in document,
    )


def document_of(robot: Robot) -> dict[str, Any]:
    """A robot as the contents of its file, the inverse of `robot_from_document`.

    `robot`: without elastic links: their tubes are no data of an arm but of a study. Returns keys as in ``schemas/robot.yaml``;
    optional ones only where they say something. Lengths stand in the chain as numbers.
    """
    counted_otherwise = (robot.reported_matrix != np.eye(robot.joints)).any() or robot.reported_offset.any()
    reported = {
        "matrix": robot.reported_matrix.tolist(),
        "offset_deg": (robot.reported_offset / _per_degree(robot.chain)).tolist(),
    }
    document = {
        "name": robot.name,
        "joint_names": robot.joint_names and list(robot.joint_names),
        "chain": notation(robot.chain),
        "joint_limits_deg": (robot.joint_limits / _per_degree(robot.chain)[:, None]).tolist(),
        "compliance_urad_per_Nm": (1e6 * robot.compliance).tolist() if robot.compliance_known else None,
        "reported_joints": reported if counted_otherwise else None,
        "masses": [vars(mass) | {"centre_m": list(mass.centre_m)} for mass in robot.masses] or None,
        "gravity_m_s2": list(robot.gravity_m_s2) if robot.gravity_m_s2 != STANDING else None,
        "gear_ratio": robot.gear_ratio and list(robot.gear_ratio),
        "compensator": robot.compensator and dict(vars(robot.compensator)),
        "payload_kg": robot.payload_kg,
    }
    return {key: value for key, value in document.items() if value is not None}


def joint_count(document: Mapping[str, Any], source: str = "robot") -> int:
    """Number of joints of the contents of a robot file.

    `source`: named in errors.
    """
    return parse_chain(document["chain"], document.get("lengths_m", {}), source).coordinates


def joint_limits(limits_deg: Sequence[Sequence[float]] | None, chain: Chain, source: str) -> np.ndarray:
    """Joint limits in rad, of prismatic joints in m.

    `limits_deg` (float, float): lower and upper limit of each joint; of prismatic ones in metres. None where nothing is known:
    a turn either way. `chain`: whose joints they are. `source`: named in errors. Returns (n, 2). Raises `InputError` where
    there are too few or too many, a lower limit is not below the upper one, or those of a prismatic joint lack.
    """
    joints = chain.coordinates
    if limits_deg is None:
        if any(chain.prismatic):
            joint = chain.prismatic.index(True) + 1
            raise InputError(source, "joint_limits_deg", f"nothing, but T.(q{joint})", "[lower, upper], for a track in metres")
        limits_deg = [UNLIMITED_DEG] * joints
    _require_each(limits_deg, joints, "joint_limits_deg", source)
    for joint, (low, high) in enumerate(limits_deg):
        if low >= high:
            raise InputError(source, f"joint_limits_deg[{joint}]", str([low, high]), "[lower, upper]")
    return np.array(limits_deg, float) * _per_degree(chain)[:, None]


def _compliance(document: Mapping[str, Any], chain: Chain, source: str) -> np.ndarray:
    if "compliance_urad_per_Nm" not in document:
        return usual_compliance(chain, document.get("payload_kg"))
    _require_each(document["compliance_urad_per_Nm"], chain.coordinates, "compliance_urad_per_Nm", source)
    return 1e-6 * np.array(document["compliance_urad_per_Nm"], float)


def _require_each(entries: Sequence[Any], joints: int, key: str, source: str, one: str = "one") -> None:
    if len(entries) != joints:
        allowed = f"{one} for each of the {joints} joints"
        raise InputError(source, key, counted(len(entries), "entry", "entries"), allowed)


def _per_degree(chain: Chain) -> np.ndarray:
    """What one degree, or of prismatic joints one metre, of a robot file is in SI units, ndarray (n,)."""
    return np.where(chain.prismatic, 1.0, math.radians(1.0))


def _masses(described: Sequence[dict[str, Any]], joints: int, source: str) -> tuple[Mass, ...]:
    masses = [Mass(**entry | {"centre_m": tuple(map(float, entry["centre_m"]))}) for entry in described]
    masses.sort(key=attrgetter("link"))
    for index, entry in enumerate(described):
        if entry["link"] > joints:
            raise InputError(
                source, f"masses[{index}].link", str(entry["link"]), f"0 for the column, or a joint up to {joints}"
            )
    for one, other in pairwise(masses):
        if one.link == other.link:
            raise InputError(source, "masses", f"link {one.link} twice", "each link once, with all that it carries")
    return tuple(masses)


def _gravity(vector: Sequence[float], source: str) -> tuple[float, ...]:
    if math.hypot(*vector) < _LEAST_GRAVITY:
        raise InputError(source, "gravity_m_s2", str(list(vector)), f"a vector in base axes of {_LEAST_GRAVITY:g} m/s² or more")
    return tuple(map(float, vector))


def _of_each_joint(document: Mapping[str, Any], key: str, joints: int, source: str, one: str) -> tuple[Any, ...] | None:
    if document.get(key) is None:
        return None
    _require_each(document[key], joints, key, source, one)
    return tuple(document[key])


def _compensator(described: Mapping[str, Any] | None, joints: int, source: str) -> Compensator | None:
    if described is None:
        return None
    if described["joint"] > joints:
        raise InputError(source, "compensator.joint", str(described["joint"]), f"a joint from 1 to {joints}")
    return Compensator(**described)


def _check_reach(chain: Chain, key: str, source: str) -> None:
    reach = sum(abs(transform.constant) for transform in chain.transforms if transform.kind == "T")
    if reach > LONGEST_REACH_M:
        allowed = f"lengths in metres (not millimetres) that reach {LONGEST_REACH_M:g} m at most"
        raise InputError(source, key, f"a chain that reaches {reach:.4g} m", allowed)


def _links(chain: Chain, described: Mapping[str, Any] | None, source: str) -> tuple[Link, ...]:
    if described is None:
        return ()
    odd = {
        "fixed rotations": any(t.kind == "R" and t.coordinate is None for t in chain.transforms),
        "prismatic joints": any(chain.prismatic),
        "passive joints": any(chain.is_passive(place) for place in range(len(chain.transforms))),
    }
    for what in (what for what, there in odd.items() if there):
        raise InputError(source, "links", f"a chain with {what}", "links on chains that turn at their joints only")
    rigid = stretches(chain)
    tubes = described["tubes"]
    if len(tubes) not in (1, len(rigid)):
        raise InputError(
            source, "links.tubes", counted(len(tubes), "tube"), f"one for all links or one for each of the {len(rigid)}"
        )
    links = []
    for number, (after, vector) in enumerate(rigid):
        size = tubes[number if len(tubes) > 1 else 0]
        if 2 * size["wall_m"] > size["outer_diameter_m"]:
            raise InputError(source, "links.tubes", f"wall_m {size['wall_m']}", "at most half the outer_diameter_m")
        tube = Tube(
            size["outer_diameter_m"],
            size["wall_m"],
            1e9 * described["youngs_modulus_GPa"],
            1e9 * described["shear_modulus_GPa"],
        )
        links.append(Link(after, vector, tube))
    return tuple(links)
