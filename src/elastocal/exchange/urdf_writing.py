"""The user's own URDF with the joint origins of the calibrated robot.

Between two moving joints, the fixed transform of the calibrated chain differs from the
nominal one by a displacement E at its end. The offset of a joint is a displacement R about
or along its axis. With G from the frame of a joint to that of the chain before it moves,
the joint's origin O becomes O G E R G^-1. The displacement behind the last moving joint
goes into the last fixed joint. Joint values mean the same before and after. A URDF is
rigid, so compliances are not in it.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from elastocal.counting import format_count
from elastocal.errors import InputError
from elastocal.exchange.robot_text import (
    compute_yaw_pitch_roll,
    express_axis,
    format_point_name,
    make_elementary_transform,
    make_transform,
)
from elastocal.exchange.urdf import LARGEST_BYTES, Joint, Urdf, find_chain, read_urdf
from elastocal.io.storage import Columns
from elastocal.io.texts import read_bytes
from elastocal.mechanics.chain import Chain, MeasuringPoint, Transform, parse_chain
from elastocal.mechanics.robot import Mass, Robot

# Upper bound on the difference of equal transforms, m and rad: rounding in a file or in a
# product of transforms.
_ROUNDING = 1e-9
# Decimals of written origins, m and rad; smaller changes of an origin are not written.
_DECIMALS = 12
# Effort (N m) and velocity (rad/s) that a URDF must state and no arm exceeds.
_UNKNOWN = "1e6"
# Density of aluminium, kg/m³.
_DENSITY = 2700.0
_IMPORTED_URDF = "the URDF from which the robot file was imported"


@dataclass(frozen=True)
class CorrectedUrdf:
    """A URDF with other joint origins.

    Attributes
    ----------
    content : contents of the file.
    changed : number of origins that differ.
    base, tip : links between which the file has the robot.
    """

    content: bytes
    changed: int
    base: str
    tip: str


@dataclass(frozen=True)
class RigidLinks:
    """A chain as transforms that move and fixed transforms between them.

    Attributes
    ----------
    moving : transforms that move.
    fixed : fixed transforms (4, 4) before, between and behind these, one more.
    """

    moving: list[Transform]
    fixed: list[np.ndarray]


def write_calibrated_origins(
    path: str | Path, nominal: Robot, calibrated: Robot
) -> CorrectedUrdf:
    """Write the joint origins of a calibrated robot into a URDF.

    A URDF cannot express factors and couplings of joint values, nor an error behind a last
    moving joint whose child is the tip.

    Parameters
    ----------
    path : URDF file
    nominal : robot that was imported from it
    calibrated : the same robot, calibrated

    Raises
    ------
    InputError
        The file has another robot.
    """
    source = Path(path).as_posix()
    content = read_bytes(path, LARGEST_BYTES, "a URDF file")
    urdf = read_urdf(path)
    base, tip = _find_ends(urdf, nominal, source)
    origins = _correct_origins(urdf.path_to(tip, base), nominal, calibrated)
    return CorrectedUrdf(_replace_origins(content, origins), len(origins), base, tip)


def find_nominal_chain(urdf: Urdf, base: str, tip: str, source: str) -> Chain:
    """Find the chain between two links of a URDF."""
    return parse_chain(find_chain(urdf, base, tip, (), source).notation, {}, source)


def _find_ends(urdf: Urdf, robot: Robot, source: str) -> tuple[str, str]:
    """Find the base and the tip between which the file has the robot's chain."""
    point = robot.chain.end_effector.name
    tips = [link for link in urdf.moments if format_point_name(link) == point]
    if not tips:
        raise InputError(
            source,
            "",
            f"no link {point!r}, the robot's last measuring point",
            _IMPORTED_URDF,
        )
    for tip in tips:
        for joint in reversed(urdf.path_to(tip, None)):
            if _has_chain(urdf, joint.parent, tip, robot, source):
                return joint.parent, tip
    joints = ", ".join(robot.joint_names or ()) or format_count(robot.joints, "joint")
    raise InputError(
        source,
        "",
        f"no chain to {point!r} by {joints} as the robot file has it",
        _IMPORTED_URDF,
    )


def _has_chain(urdf: Urdf, base: str, tip: str, robot: Robot, source: str) -> bool:
    """Decide whether the chain between two links has the joint names, if the robot has
    any, and the transforms of the robot."""
    try:
        urdf_chain = find_chain(urdf, base, tip, (), source)
        chain = parse_chain(urdf_chain.notation, {}, source)
    except InputError:
        return False
    joint_names = tuple(joint.name for joint in urdf_chain.joints)
    if robot.joint_names and robot.joint_names != joint_names:
        return False
    links = split_chain(chain)
    robot_links = split_chain(robot.chain)
    return links.moving == robot_links.moving and bool(
        np.abs(np.subtract(links.fixed, robot_links.fixed)).max() < _ROUNDING
    )


def split_chain(chain: Chain) -> RigidLinks:
    """Split a chain into transforms that move and fixed transforms between them."""
    links = RigidLinks([], [np.eye(4)])
    for transform in chain.transforms:
        if transform.coordinate is None:
            links.fixed[-1] = links.fixed[-1] @ make_elementary_transform(
                transform.kind, transform.axis, transform.constant
            )
        else:
            links.moving.append(transform)
            links.fixed.append(np.eye(4))
    return links


def _correct_origins(
    path: list[Joint], nominal: Robot, calibrated: Robot
) -> dict[str, np.ndarray]:
    """Correct the origins (4, 4) of the joints of a path; return those that differ, by
    the name of the joint."""
    nominal_links = split_chain(nominal.chain)
    calibrated_fixed = split_chain(calibrated.chain).fixed
    offset = find_offset_at_zero(nominal, calibrated)
    origins = {}
    frame = np.eye(4)
    number = 0
    for joint in path:
        frame = frame @ joint.origin
        nominal_fixed = nominal_links.fixed[number]
        change = np.eye(4)
        error = np.linalg.inv(nominal_fixed) @ calibrated_fixed[number]
        if joint.kind != "fixed":
            moving = nominal_links.moving[number]
            assert moving.coordinate is not None
            amount = moving.sign * offset[moving.coordinate]
            error = error @ make_elementary_transform(moving.kind, moving.axis, amount)
            to_chain = np.linalg.inv(frame) @ nominal_fixed
            change = to_chain @ error @ np.linalg.inv(to_chain)
            number += 1
            frame = make_transform(express_axis(joint.axis).rotation.T)
        elif joint is path[-1]:
            change = error
        if np.abs(change - np.eye(4)).max() > 10.0**-_DECIMALS:
            origins[joint.name] = joint.origin @ change
    return origins


def find_offset_at_zero(nominal: Robot, calibrated: Robot) -> np.ndarray:
    """Angles of the calibrated robot at which those of the nominal robot are zero,
    ndarray (n,): the joint values of the URDF are the nominal angles."""
    inverse = np.linalg.pinv(nominal.reported_matrix)
    change = calibrated.reported_matrix - nominal.reported_matrix
    factor = np.eye(nominal.joints) + change @ inverse
    return calibrated.reported_offset - factor @ nominal.reported_offset


def build_urdf(nominal: Robot, calibrated: Robot) -> str:
    """Build a URDF of a calibrated robot that was not imported from one.

    Its joints have the names of the robot, or ``joint1`` and so on, and values that mean
    the angles of the nominal chain. The base is ``base_link``; the last link has the name
    of the last measuring point. Factors and couplings of joint values have no place in it,
    but joints that follow one other joint mimic it.
    """
    root = ElementTree.Element("robot", name=format_point_name(calibrated.name))
    links = split_chain(calibrated.chain)
    offset = find_offset_at_zero(nominal, calibrated)
    masses = {mass.link: mass for mass in calibrated.masses}
    parent = _add_link(root, "base_link", masses.get(0))
    names = calibrated.joint_names or number_joints(calibrated.joints)
    for number, moving in enumerate(links.moving):
        child = _add_link(root, f"link{number + 1}", masses.get(number + 1))
        shift = moving.sign * offset[number]
        change = make_elementary_transform(moving.kind, moving.axis, shift)
        origin = links.fixed[number] @ change
        kind = "revolute" if moving.kind == "R" else "prismatic"
        joint = _add_joint(root, names[number], kind, (parent, child), origin)
        _limit_motion(joint, moving, nominal.joint_limits[number])
        follower = find_followed_joint(nominal, number)
        if follower is not None:
            _add_mimic(joint, names[follower.joint], follower)
        parent = child
    _add_tip(root, parent, calibrated.chain.end_effector, links.fixed[-1])
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode") + "\n"


@dataclass(frozen=True)
class Follower:
    """A joint whose angle is a multiple of that of another joint, plus an offset.

    Attributes
    ----------
    joint : number of the other joint, from 0.
    multiplier, offset : rad/rad and rad; m for prismatic joints.
    """

    joint: int
    multiplier: float
    offset: float


def find_followed_joint(robot: Robot, number: int) -> Follower | None:
    """Find the joint that a joint of the chain, counted from 0, follows; None if it leads
    or follows several joints."""
    commands = np.flatnonzero(robot.reported_matrix[number])
    if number in robot.leading_joints or len(commands) != 1:
        return None
    for joint in robot.leading_joints.tolist():
        factors = robot.reported_matrix[joint]
        if np.array_equal(np.flatnonzero(factors), commands):
            command = commands[0]
            multiplier = float(
                robot.reported_matrix[number, command] / factors[command]
            )
            offset = robot.reported_offset[number]
            offset -= multiplier * robot.reported_offset[joint]
            return Follower(joint, multiplier, float(offset))
    return None


def _add_mimic(joint: ElementTree.Element, name: str, follower: Follower) -> None:
    """Let a joint follow the joint with a name."""
    ElementTree.SubElement(
        joint,
        "mimic",
        joint=name,
        multiplier=repr(follower.multiplier),
        offset=repr(follower.offset),
    )


def _add_link(root: ElementTree.Element, name: str, mass: Mass | None) -> str:
    """Add a link with its weight, if it is known; return its name."""
    link = ElementTree.SubElement(root, "link", name=name)
    if mass is not None and mass.mass_kg > 0.0:
        inertial = ElementTree.SubElement(link, "inertial")
        ElementTree.SubElement(inertial, "origin", xyz=_format_numbers(mass.centre_m))
        ElementTree.SubElement(inertial, "mass", value=repr(float(mass.mass_kg)))
        moment = repr(estimate_inertia(mass.mass_kg))
        moments = dict.fromkeys(("ixx", "iyy", "izz"), moment)
        products = dict.fromkeys(("ixy", "ixz", "iyz"), "0")
        ElementTree.SubElement(inertial, "inertia", moments | products)
    return name


def _add_joint(
    root: ElementTree.Element,
    name: str,
    kind: str,
    ends: tuple[str, str],
    origin: np.ndarray,
) -> ElementTree.Element:
    """Add a joint between two links."""
    joint = ElementTree.SubElement(root, "joint", name=name, type=kind)
    roll_pitch_yaw = np.array(compute_yaw_pitch_roll(origin[:3, :3]))[::-1]
    ElementTree.SubElement(
        joint,
        "origin",
        xyz=_format_numbers(origin[:3, 3]),
        rpy=_format_numbers(roll_pitch_yaw),
    )
    for role, link in zip(("parent", "child"), ends, strict=True):
        ElementTree.SubElement(joint, role, link=link)
    return joint


def _add_tip(
    root: ElementTree.Element, parent: str, point: MeasuringPoint, fixed: np.ndarray
) -> None:
    """Add a link at a measuring point, behind a fixed transform (4, 4) of the last
    moving link."""
    tip = _add_link(root, format_point_name(point.name), None)
    origin = fixed @ make_transform(np.eye(3), point.offset_m)
    _add_joint(root, f"{parent}_to_{tip}", "fixed", (parent, tip), origin)


def number_joints(joints: int) -> tuple[str, ...]:
    """Name the joints of a robot that states no names: ``joint1`` and so on."""
    return tuple(f"joint{number}" for number in range(1, joints + 1))


def _limit_motion(
    joint: ElementTree.Element, moving: Transform, limits: np.ndarray
) -> None:
    """Add axis and limits (2,) of a joint that moves."""
    axis = moving.sign * np.eye(3)[moving.axis]
    ElementTree.SubElement(joint, "axis", xyz=_format_numbers(axis))
    low, high = map(repr, limits.tolist())
    ElementTree.SubElement(
        joint, "limit", lower=low, upper=high, effort=_UNKNOWN, velocity=_UNKNOWN
    )


def estimate_inertia(mass_kg: float) -> float:
    """Estimate the moment of inertia of a body whose mass alone is known, kg m²: that of
    a ball of aluminium."""
    radius = (0.75 * mass_kg / (math.pi * _DENSITY)) ** (1.0 / 3.0)
    return float(0.4 * mass_kg * radius**2)


def _replace_origins(content: bytes, origins: Columns) -> bytes:
    """Replace the origins of joints in a file; comments inside the robot stay."""
    builder = ElementTree.TreeBuilder(insert_comments=True, insert_pis=True)
    root = ElementTree.fromstring(content, ElementTree.XMLParser(target=builder))
    for joint in root.findall("{*}joint"):
        transform = origins.get(joint.get("name", ""))
        if transform is None:
            continue
        origin = joint.find("{*}origin")
        if origin is None:
            origin = ElementTree.SubElement(joint, "origin")
        roll_pitch_yaw = np.array(compute_yaw_pitch_roll(transform[:3, :3]))[::-1]
        origin.set("xyz", _format_numbers(transform[:3, 3]))
        origin.set("rpy", _format_numbers(roll_pitch_yaw))
    xml: bytes = ElementTree.tostring(root, encoding="utf-8", xml_declaration=True)
    return xml + b"\n"


def _format_numbers(values: Sequence[float] | np.ndarray) -> str:
    return " ".join(repr(round(float(value), _DECIMALS) + 0.0) for value in values)
