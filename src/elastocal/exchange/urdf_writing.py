"""A robot file's chain as URDF: joints with their origins, axes and limits, masses, and measuring points as links.

URDF [1] is rigid: compliances are not in it. Joint values are the controller's where it counts each joint by itself, in
either sense; where it couples joints they are the angles of the chain, and a comment says so. A joint that stands in two places
becomes a mimic joint. Masses are point masses; MuJoCo, which moves nothing without mass and inertia, is given the least. A URDF
from which the robot was imported comes back by `urdf_origins`.

[1] ROS, XML Robot Description Format (URDF), https://wiki.ros.org/urdf/XML
"""

import math
from xml.etree import ElementTree as Xml

import numpy as np

from elastocal.exchange.fixed_transforms import elementary, yaw_pitch_roll
from elastocal.mechanics.robot import Robot

# URDF asks for them, and 0 is a joint that nothing moves; a robot file does not know them.
_UNLIMITED = "1e9"
# MuJoCo's own extension of URDF, which other readers skip; kg and kg m².
_LEAST = {"boundmass": "1e-6", "boundinertia": "1e-9"}


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
            offset = np.eye(4)
            offset[:3, 3] = point.offset_m
            _joint(root, f"to_{point.name}", "fixed", parent, point.name, here @ offset)
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
