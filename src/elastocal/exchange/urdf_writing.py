"""The calibrated robot as URDF [1]: of a robot file's chain, or the user's own file with other joint origins.

URDF is rigid: compliances are not in it. Of a robot file's chain it has joints with their origins, axes and limits, masses, and
measuring points as links. Joint values are the controller's where it counts each joint by itself, in either sense; where it
couples joints they are the angles of the chain, and a comment says so. A joint that stands in two places becomes a mimic joint.
Masses are point masses; MuJoCo, which moves nothing without mass and inertia, is given the least.

A URDF from which the robot was imported comes back with other joint origins. Between two joints that move, the calibrated
chain has a fixed transform that differs from the nominal one by a displacement E at its end, and an offset of the
joint is a turn R about (or a shift along) its axis. With G from a joint's frame to the chain's before it moves, its origin O
becomes O G E R G^-1; what lies behind the last joint goes into the last fixed joint. Joint values are those of the URDF, before
and after.

[1] ROS, XML Robot Description Format (URDF), https://wiki.ros.org/urdf/XML
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree as Xml

import numpy as np

from elastocal.counting import counted
from elastocal.errors import InputError
from elastocal.exchange.fixed_transforms import axis_rotation, elementary, homogeneous, yaw_pitch_roll
from elastocal.exchange.robot_text import point_name
from elastocal.exchange.urdf import LARGEST_BYTES, Joint, Urdf, UrdfChain, chain_between, read_urdf
from elastocal.io.texts import read_bytes
from elastocal.mechanics.chain import Chain, Transform, parse_chain
from elastocal.mechanics.robot import Robot

# URDF asks for them, and 0 is a joint that nothing moves; a robot file does not know them.
_UNLIMITED = "1e9"
# MuJoCo's own extension of URDF, which other readers skip; kg and kg m².
_LEAST = {"boundmass": "1e-6", "boundinertia": "1e-9"}
# m and rad: of rounding, in a file or in a product of transforms.
_SAME, _DECIMALS = 1e-9, 12
_THE_SAME = "the URDF from which the robot file was imported"


def urdf_of(robot: Robot, comment: str = "") -> str:
    """A robot as URDF.

    `comment`: stands at the top. Returns links ``base``, ``link_1 .. link_n``, and one for each measuring point by its name.
    """
    own = robot.counts_each_joint
    sense = np.diag(robot.reported_matrix) if own else np.ones(robot.joints)
    zero = robot.reported_offset if own else np.zeros(robot.joints)
    names = robot.joint_names or tuple(f"joint_{j}" for j in range(1, robot.joints + 1))
    root = Xml.Element("robot", name=robot.name.replace(" ", "_"))
    coupled = "" if own else " Joint values are angles of the chain: the controller couples joints, see the robot file."
    root.append(Xml.Comment(f" {comment}{coupled} ".replace("--", "- -")))
    Xml.SubElement(Xml.SubElement(root, "mujoco"), "compiler", _LEAST)
    _link(root, robot, 0, "base")
    parent, here, places = "base", np.eye(4), {point.after: point for point in robot.chain.points}
    for place in range(len(robot.chain.transforms) + 1):
        if place in places:
            point = places[place]
            at = here @ homogeneous(np.eye(3), point.offset_m)
            _joint(root, f"to_{point.name}", "fixed", parent, point.name, at)
            Xml.SubElement(root, "link", name=point.name)
            if not any(point.offset_m):
                parent, here = point.name, np.eye(4)
        if place == len(robot.chain.transforms):
            break
        transform = robot.chain.transforms[place]
        if transform.coordinate is None:
            here = here @ elementary(transform.kind, transform.axis, transform.constant)
            continue
        joint, passive = transform.coordinate, robot.chain.is_passive(place)
        start = here @ elementary(transform.kind, transform.axis, transform.sign * zero[joint])
        name = f"{names[joint]}_again_{place}" if passive else names[joint]
        child = f"passive_{place}" if passive else f"link_{joint + 1}"
        element = _joint(root, name, "prismatic" if transform.kind == "T" else "revolute", parent, child, start)
        axis = transform.sign * sense[joint] * np.eye(3)[transform.axis]
        Xml.SubElement(element, "axis", xyz=_numbers(axis + 0.0))
        low, high = (repr(float(limit)) for limit in sorted((robot.joint_limits[joint] - zero[joint]) / sense[joint]))
        Xml.SubElement(element, "limit", lower=low, upper=high, effort=_UNLIMITED, velocity=_UNLIMITED)
        if passive:
            Xml.SubElement(element, "mimic", joint=names[joint], multiplier="1", offset="0")
        _link(root, robot, None if passive else joint + 1, child)
        parent, here = child, np.eye(4)
    Xml.indent(root)
    return '<?xml version="1.0"?>\n' + Xml.tostring(root, encoding="unicode") + "\n"


def _joint(root: Xml.Element, name: str, kind: str, parent: str, child: str, at: np.ndarray) -> Xml.Element:
    element = Xml.SubElement(root, "joint", name=name, type=kind)
    turn = np.array(yaw_pitch_roll(at[:3, :3]))[::-1]
    Xml.SubElement(element, "origin", xyz=_numbers(at[:3, 3]), rpy=_numbers(turn))
    Xml.SubElement(element, "parent", link=parent)
    Xml.SubElement(element, "child", link=child)
    return element


def _link(root: Xml.Element, robot: Robot, body: int | None, name: str) -> None:
    link = Xml.SubElement(root, "link", name=name)
    for mass in robot.masses:
        if mass.link == body:
            inertial = Xml.SubElement(link, "inertial")
            Xml.SubElement(inertial, "origin", xyz=_numbers(np.array(mass.centre_m)), rpy="0 0 0")
            Xml.SubElement(inertial, "mass", value=repr(float(mass.mass_kg)))
            Xml.SubElement(inertial, "inertia", dict.fromkeys(("ixx", "ixy", "ixz", "iyy", "iyz", "izz"), "0"))


def _numbers(values: np.ndarray) -> str:
    return " ".join(repr(float(value)) if math.isfinite(value) else "0" for value in values)


@dataclass(frozen=True)
class CorrectedUrdf:
    """The file's new contents, how many origins differ, and the links between which the robot stands."""

    content: bytes
    changed: int
    base: str
    tip: str


def write_calibrated_origins(path: str | Path, nominal: Robot, calibrated: Robot) -> CorrectedUrdf:
    """A URDF of which `nominal` was imported, with the joint origins of the same robot as `calibrated` has it.

    A factor or a coupling of joint values, and an error behind a last joint whose child is the tip, have no place in it.
    An `InputError` refuses another robot's file.
    """
    source = Path(path).as_posix()
    content = read_bytes(path, LARGEST_BYTES, "a URDF file")
    urdf = read_urdf(path)
    base, tip = _ends_of(urdf, nominal, source)
    origins = _origins(urdf.path_to(tip, base), nominal, calibrated)
    return CorrectedUrdf(_edit(content, origins), len(origins), base, tip)


def nominal_chain(urdf: Urdf, base: str, tip: str, source: str) -> tuple[UrdfChain, Chain]:
    """The chain between two links, and the same as `mechanics` has it."""
    found = chain_between(urdf, base, tip, (), source)
    return found, parse_chain(found.notation, {}, source)


def _ends_of(urdf: Urdf, robot: Robot, source: str) -> tuple[str, str]:
    """Base and tip between which the file has the robot's chain."""
    wanted, names = robot.chain.end_effector.name, robot.joint_names
    tips = [name for name in urdf.moments if point_name(name) == wanted]
    if not tips:
        raise InputError(source, "", f"no link {wanted!r}, the robot's last measuring point", _THE_SAME)
    differ = None
    for tip in tips:
        for joint in reversed(urdf.path_to(tip, None)):
            try:
                found, chain = nominal_chain(urdf, joint.parent, tip, source)
            except InputError:
                continue
            joints = tuple(each.name for each in found.joints)
            if len(joints) == robot.joints and names in (None, (), joints):
                if _is_same(chain, robot.chain):
                    return joint.parent, tip
                differ = differ or joints
    found_words = f"no chain to {wanted!r} by {', '.join(names or ()) or counted(robot.joints, 'joint')}"
    if differ:
        found_words = f"a chain by {', '.join(differ)} to {wanted!r} that is not the robot file's"
    raise InputError(source, "", found_words, _THE_SAME)


def _is_same(chain: Chain, other: Chain) -> bool:
    """Whether two chains move the same, joint by joint."""
    (fixed, moving), (theirs, their_moving) = _stretches(chain), _stretches(other)
    near = (np.abs(mine - wanted).max() < _SAME for mine, wanted in zip(fixed, theirs, strict=False))
    return moving == their_moving and all(near)


def _stretches(chain: Chain) -> tuple[list[np.ndarray], list[Transform]]:
    """Fixed transforms (4, 4) before, between and behind those that move; and these."""
    fixed, moving = [np.eye(4)], []
    for transform in chain.transforms:
        if transform.coordinate is None:
            fixed[-1] = fixed[-1] @ elementary(transform.kind, transform.axis, transform.constant)
        else:
            moving.append(transform)
            fixed.append(np.eye(4))
    return fixed, moving


def _origins(path: list[Joint], nominal: Robot, calibrated: Robot) -> dict[str, np.ndarray]:
    """New origins (4, 4) by name of the joint, of those that differ."""
    (before, moving), (after, _) = _stretches(nominal.chain), _stretches(calibrated.chain)
    # The URDF's joint values are the nominal angles: what the calibrated ones are where these are 0.
    factor = calibrated.reported_matrix @ np.linalg.inv(nominal.reported_matrix)
    offset = calibrated.reported_offset - factor @ nominal.reported_offset
    found, here, number = {}, np.eye(4), 0
    for joint in path:
        here, change = here @ joint.origin, np.eye(4)
        moves = joint.kind != "fixed"
        error = np.linalg.inv(before[number]) @ after[number]
        if moves:
            transform = moving[number]
            assert transform.coordinate is not None
            to_chain = np.linalg.inv(here) @ before[number]
            error = error @ elementary(transform.kind, transform.axis, transform.sign * offset[transform.coordinate])
            change = to_chain @ error @ np.linalg.inv(to_chain)
            number, here = number + 1, homogeneous(axis_rotation(joint.axis).T)
        elif joint is path[-1]:
            change = error
        if np.abs(change - np.eye(4)).max() > 10.0**-_DECIMALS:
            found[joint.name] = joint.origin @ change
    return found


def _edit(content: bytes, origins: Mapping[str, np.ndarray]) -> bytes:
    """The file with other origins; comments inside of the robot stay."""
    builder = Xml.TreeBuilder(insert_comments=True, insert_pis=True)
    root = Xml.fromstring(content, Xml.XMLParser(target=builder))
    for joint in root.findall("{*}joint"):
        if (transform := origins.get(joint.get("name", ""))) is not None:
            origin = joint.find("{*}origin")
            element = Xml.SubElement(joint, "origin") if origin is None else origin
            turn = np.array(yaw_pitch_roll(transform[:3, :3]))[::-1]
            for attribute, numbers in (("xyz", transform[:3, 3]), ("rpy", turn)):
                element.set(attribute, " ".join(repr(round(float(number), _DECIMALS) + 0.0) for number in numbers))
    written: bytes = Xml.tostring(root, encoding="utf-8", xml_declaration=True)
    return written + b"\n"
