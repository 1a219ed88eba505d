"""Read and write robot files, with the checks that the file's schema cannot make.

The chain is in the notation of `chain`. Without ``joint_limits_deg`` a joint makes one
turn either way. Without ``compliance_urad_per_Nm`` the compliances have to be
identified, or the joints count as rigid if nothing loads them. A robot file may state
the masses of the links::

    masses:
      - {link: 2, mass_kg: 190, centre_m: [0.52, 0.0, 0.03], relative_std: 0.1}
    gravity_m_s2: [0, 0, -9.80665]
    gear_ratio: [null, 171, 153, null, null, null]
    compensator: {joint: 2, kind: spring}
    payload_kg: 165

Link k is carried by joint k; link 0 is the column before joint 1. ``centre_m`` is
stated in the frame of the chain directly behind the transform ``R.(qk)``, for link 0 in
the base frame. The origin of this frame lies on the axis of joint k, at the position of
the joint in the chain, and its axes turn with the joint, so that one axis is that of
the joint. With all joints at zero its axes are base axes, unless the chain has fixed
rotations before. ``relative_std`` is the standard deviation of the mass over the mass,
and of each component of the centre over its distance from the origin (0.1 m at least).
Gravity is given in base axes: it is different for a robot on a wall or a tilted foot.
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

# Upper bound on the sum of lengths of a chain. The longest serial arms of the market
# reach 4.7 m, and their lengths, with the column, sum to 7 m. Lengths of any arm in
# centimetres, inches or millimetres exceed the bound.
LONGEST_REACH_M = 10.0
# Upper bound on the limits of a prismatic joint: tracks of robots are up to some tens of
# metres long, and a shorter one in millimetres has larger numbers.
_LONGEST_TRACK_M = 100.0
# Lower bound on gravity, m/s²; the microgravity of an orbit is some 1e-5 m/s².
_LEAST_GRAVITY = 1e-6


def parse_robot(document: Mapping[str, Any], source: str = "robot") -> Robot:
    """Make a robot from the contents of its file.

    Parameters
    ----------
    document : contents, valid by ``schemas/robot.yaml``
    source : name of the file for errors

    Raises
    ------
    InputError
        If the chain does not parse or reaches farther than any machine, a list has
        another length than there are joints, or a value is impossible.
    """
    chain = parse_chain(document["chain"], document.get("lengths_m", {}), source)
    _check_reach(chain, "lengths_m" if document.get("lengths_m") else "chain", source)
    n = chain.coordinates
    gravity = tuple(map(float, document.get("gravity_m_s2", STANDING)))
    if math.hypot(*gravity) < _LEAST_GRAVITY:
        allowed = f"a vector in base axes of {_LEAST_GRAVITY:g} m/s² or more"
        raise InputError(source, "gravity_m_s2", str(document["gravity_m_s2"]), allowed)
    compensator = None
    if document.get("compensator"):
        compensator = Compensator(**document["compensator"])
        if compensator.joint > n:
            joint = str(compensator.joint)
            allowed = f"a joint from 1 to {n}"
            raise InputError(source, "compensator.joint", joint, allowed)
    payload_kg = document.get("payload_kg")
    compliance = estimate_typical_compliance(chain, payload_kg)
    stated = _get_joint_entries(document, "compliance_urad_per_Nm", n, source)
    if stated is not None:
        compliance = 1e-6 * np.array(stated, float)
    matrix, offset = _parse_reported_joints(document, chain, source)
    return Robot(
        name=document["name"],
        chain=chain,
        compliance=compliance,
        joint_limits=parse_joint_limits(document, chain, source),
        links=_parse_links(chain, document.get("links"), source),
        reported_matrix=matrix,
        reported_offset=offset,
        masses=_parse_masses(document.get("masses", ()), n, source),
        gravity_m_s2=gravity,
        base_moves=_parse_base(document, source),
        gear_ratio=_get_joint_entries(document, "gear_ratio", n, source, "one or null"),
        compensator=compensator,
        payload_kg=payload_kg,
        joint_names=_get_joint_entries(document, "joint_names", n, source),
        stated_command_names=_parse_command_names(document, matrix, source),
        compliance_known=stated is not None,
    )


def describe_robot(robot: Robot) -> dict[str, Any]:
    """Describe a robot without elastic links as the contents of its file, the inverse
    of `parse_robot`.

    Optional keys with their default values are left out; the chain contains lengths as
    numbers.
    """
    units = _units(robot.chain)
    document: dict[str, Any] = {
        "name": robot.name,
        "joint_names": robot.joint_names and list(robot.joint_names),
        "chain": format_chain(robot.chain),
        "joint_limits_deg": (robot.joint_limits / units[:, None]).tolist(),
    }
    if robot.compliance_known:
        document["compliance_urad_per_Nm"] = (1e6 * robot.compliance).tolist()
    matrix = robot.reported_matrix
    is_identity = np.array_equal(matrix, np.eye(robot.joints))
    if not is_identity or robot.reported_offset.any():
        document["reported_joints"] = {
            "matrix": matrix.tolist(),
            "offset_deg": (robot.reported_offset / units).tolist(),
        }
    if robot.stated_command_names is not None:
        reported = document.setdefault("reported_joints", {})
        reported["names"] = list(robot.stated_command_names)
    if robot.masses:
        document["masses"] = [
            vars(mass) | {"centre_m": list(mass.centre_m)} for mass in robot.masses
        ]
    if robot.gravity_m_s2 != STANDING:
        document["gravity_m_s2"] = list(robot.gravity_m_s2)
    if robot.base_moves:
        document["base_moves"] = True
    document |= {
        "gear_ratio": robot.gear_ratio and list(robot.gear_ratio),
        "compensator": robot.compensator and dict(vars(robot.compensator)),
        "payload_kg": robot.payload_kg,
    }
    return {key: value for key, value in document.items() if value is not None}


def _parse_base(document: Mapping[str, Any], source: str) -> bool:
    """Return whether the base moves, and refuse weights if it does."""
    moves = bool(document.get("base_moves", False))
    for key in ("masses", "gravity_m_s2", "compensator"):
        if moves and document.get(key):
            problem = "a weight beside base_moves"
            allowed = "no weight, because the direction of gravity is unknown"
            raise InputError(source, key, problem, allowed)
    return moves


def parse_joint_limits(
    document: Mapping[str, Any], chain: Chain, source: str
) -> np.ndarray:
    """Convert joint limits to an array (n, 2) in rad, of prismatic joints in m.

    Parameters
    ----------
    document : mapping
        With ``joint_limits_deg``: lower and upper limit of each joint, of prismatic
        joints in metres. Without them a joint makes one turn either way.
    chain : Chain
    source : name of the file for errors

    Raises
    ------
    InputError
        If there are too few or too many limits, a lower limit is not below the upper
        one, or a prismatic joint has no limits or some in millimetres.
    """
    limits = _get_joint_entries(document, "joint_limits_deg", chain.coordinates, source)
    if limits is None:
        if any(chain.prismatic):
            track = f"nothing, but T.(q{chain.prismatic.index(True) + 1})"
            allowed = "[lower, upper], for a track in metres"
            raise InputError(source, "joint_limits_deg", track, allowed)
        limits = (UNLIMITED_DEG,) * chain.coordinates
    for joint, (low, high) in enumerate(limits):
        key = f"joint_limits_deg[{joint}]"
        if low >= high:
            raise InputError(source, key, str([low, high]), "[lower, upper]")
        if chain.prismatic[joint] and max(-low, high) > _LONGEST_TRACK_M:
            allowed = f"metres (not millimetres), {_LONGEST_TRACK_M:g} m at most"
            raise InputError(source, key, str([low, high]), allowed)
    return np.array(limits, float) * _units(chain)[:, None]


def _check_reach(chain: Chain, key: str, source: str) -> None:
    """Refuse a chain that is longer than any machine."""
    reach = sum(
        abs(transform.constant)
        for transform in chain.transforms
        if transform.kind == "T"
    )
    if reach > LONGEST_REACH_M:
        limit = f"{LONGEST_REACH_M:g} m at most"
        allowed = f"lengths in metres (not millimetres) that reach {limit}"
        raise InputError(source, key, f"a chain that reaches {reach:.4g} m", allowed)


def _units(chain: Chain) -> np.ndarray:
    """Return the unit of each joint in a robot file, a degree or, for prismatic joints,
    a metre, in SI units, (n,) array."""
    return np.where(chain.prismatic, 1.0, math.radians(1.0))


def _parse_reported_joints(
    document: Mapping[str, Any], chain: Chain, source: str
) -> tuple[np.ndarray, np.ndarray]:
    """Return the matrix and offset of reported joint angles, see `Robot`."""
    n = chain.coordinates
    reported = document.get("reported_joints", {})
    rows = reported.get("matrix", np.eye(n).tolist())
    offset = reported.get("offset_deg", [0.0] * n)
    widths = {len(row) for row in rows}
    if (
        len(rows) != n
        or len(widths) != 1
        or len(offset) != n
        or not 0 < max(widths) <= n
    ):
        lengths = [len(row) for row in rows]
        shape = f"rows of {lengths} and {format_count(len(offset), 'offset')}"
        allowed = (
            f"{n} rows, each of the same count of numbers up to {n}, and {n} offsets"
        )
        raise InputError(source, "reported_joints", shape, allowed)
    matrix = np.array(rows, float)
    commands = matrix.shape[1]
    if np.linalg.matrix_rank(matrix) < commands:
        problem = "a matrix by which several reported angles mean the same pose"
        allowed = "independent columns: no reported joint without one of its own"
        raise InputError(source, "reported_joints", problem, allowed)
    return matrix, np.array(offset, float) * _units(chain)


def _parse_command_names(
    document: Mapping[str, Any], matrix: np.ndarray, source: str
) -> tuple[str, ...] | None:
    """Return the names of reported joints, None without them."""
    names = document.get("reported_joints", {}).get("names")
    if names is None:
        return None
    if len(names) != matrix.shape[1]:
        count = format_count(len(names), "name")
        allowed = f"one for each of the {matrix.shape[1]} reported joints"
        raise InputError(source, "reported_joints.names", count, allowed)
    return tuple(names)


def _parse_masses(
    entries: Sequence[dict[str, Any]], joints: int, source: str
) -> tuple[Mass, ...]:
    """Make masses in the order of the links, each of which may have one mass."""
    masses = []
    for index, entry in enumerate(entries):
        if entry["link"] > joints:
            key = f"masses[{index}].link"
            allowed = f"0 for the column, or a joint up to {joints}"
            raise InputError(source, key, str(entry["link"]), allowed)
        centre_m = tuple(map(float, entry["centre_m"]))
        masses.append(Mass(**entry | {"centre_m": centre_m}))
    masses.sort(key=attrgetter("link"))
    for mass, successor in pairwise(masses):
        if mass.link == successor.link:
            allowed = "each link once, with all that it carries"
            raise InputError(source, "masses", f"link {mass.link} twice", allowed)
    return tuple(masses)


def _get_joint_entries(
    document: Mapping[str, Any], key: str, joints: int, source: str, entry: str = "one"
) -> tuple[Any, ...] | None:
    """Return the entries of a list with one entry for each joint, None without it."""
    entries = document.get(key)
    if entries is None:
        return None
    if len(entries) != joints:
        count = format_count(len(entries), "entry", "entries")
        allowed = f"{entry} for each of the {joints} joints"
        raise InputError(source, key, count, allowed)
    return tuple(entries)


def _parse_links(
    chain: Chain, document: Mapping[str, Any] | None, source: str
) -> tuple[Link, ...]:
    """Model each rigid section between joints as a tube, as ``links`` of a robot file
    describes it."""
    if document is None:
        return ()
    unsupported = ""
    if any(chain.prismatic):
        unsupported = "prismatic joints"
    if any(t.kind == "R" and t.coordinate is None for t in chain.transforms):
        unsupported = "fixed rotations"
    if unsupported:
        allowed = "links on chains that turn at their joints only"
        raise InputError(source, "links", f"a chain with {unsupported}", allowed)
    sections = _find_rigid_sections(chain)
    tubes = []
    for entry in document["tubes"]:
        tube = Tube(
            entry["outer_diameter_m"],
            entry["wall_m"],
            1e9 * document["youngs_modulus_GPa"],
            1e9 * document["shear_modulus_GPa"],
        )
        if 2 * tube.wall_m > tube.outer_diameter_m:
            wall = f"wall_m {tube.wall_m}"
            allowed = "at most half the outer_diameter_m"
            raise InputError(source, "links.tubes", wall, allowed)
        tubes.append(tube)
    if len(tubes) not in (1, len(sections)):
        allowed = f"one for all links or one for each of the {len(sections)}"
        count = format_count(len(tubes), "tube")
        raise InputError(source, "links.tubes", count, allowed)
    # A single tube is used for all links.
    tubes *= len(sections) // len(tubes)
    return tuple(
        Link(after, vector_m, tube)
        for (after, vector_m), tube in zip(sections, tubes, strict=True)
    )


def _find_rigid_sections(chain: Chain) -> list[tuple[int, tuple[float, ...]]]:
    """Find the rigid sections of a chain of revolute joints without fixed rotations.

    Returns for each section the number of transforms before its far end, and the vector
    along it, m.
    """
    sections = []
    vector = np.zeros(3)
    for index, transform in enumerate(chain.transforms, 1):
        vector[transform.axis] += transform.constant
        is_joint = transform.kind == "R"
        if (is_joint or index == len(chain.transforms)) and vector.any():
            sections.append((index - is_joint, tuple(vector.tolist())))
            vector[:] = 0.0
    return sections
