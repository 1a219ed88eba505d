"""The user's own URDF with the joint origins of the calibrated robot.

Between two joints that move, the calibrated chain has a fixed transform that differs
from the nominal one by a displacement E at its end, and an offset of the joint is a
turn R about (or a shift along) its axis. With G from a joint's frame to the chain's
before it moves, its origin O becomes O G E R G^-1; what lies behind the last joint goes
into the last fixed joint. Joint values are those of the URDF, before and after. URDF is
rigid: compliances are not in it.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree as Xml

import numpy as np

from elastocal.counting import format_count
from elastocal.errors import InputError
from elastocal.exchange.robot_text import (
    elementary,
    express_axis,
    homogeneous,
    point_name,
    yaw_pitch_roll,
)
from elastocal.exchange.urdf import (
    LARGEST_BYTES,
    Joint,
    Urdf,
    UrdfChain,
    chain_between,
    read_urdf,
)
from elastocal.io.texts import read_bytes
from elastocal.mechanics.chain import Chain, Transform, parse_chain
from elastocal.mechanics.robot import Robot

# m and rad: of rounding, in a file or in a product of transforms.
_SAME = 1e-9
_DECIMALS = 12
_THE_SAME = "the URDF from which the robot file was imported"


@dataclass(frozen=True)
class CorrectedUrdf:
    """The file's new contents, how many origins differ, and the links between which the
    robot stands."""

    content: bytes
    changed: int
    base: str
    tip: str


def write_calibrated_origins(
    path: str | Path, nominal: Robot, calibrated: Robot
) -> CorrectedUrdf:
    """A URDF of which `nominal` was imported, with the joint origins of the same robot
    as `calibrated` has it.

    A factor or a coupling of joint values, and an error behind a last joint whose child
    is the tip, have no place in it. An `InputError` refuses another robot's file.
    """
    source = Path(path).as_posix()
    content = read_bytes(path, LARGEST_BYTES, "a URDF file")
    urdf = read_urdf(path)
    base, tip = _ends_of(urdf, nominal, source)
    origins = _origins(urdf.path_to(tip, base), nominal, calibrated)
    return CorrectedUrdf(_edit(content, origins), len(origins), base, tip)


def nominal_chain(
    urdf: Urdf, base: str, tip: str, source: str
) -> tuple[UrdfChain, Chain]:
    """The chain between two links, and the same as `mechanics` has it."""
    found = chain_between(urdf, base, tip, (), source)
    return found, parse_chain(found.notation, {}, source)


def _ends_of(urdf: Urdf, robot: Robot, source: str) -> tuple[str, str]:
    """Base and tip between which the file has the robot's chain."""
    wanted = robot.chain.end_effector.name
    names = robot.joint_names
    tips = [name for name in urdf.moments if point_name(name) == wanted]
    if not tips:
        raise InputError(
            source,
            "",
            f"no link {wanted!r}, the robot's last measuring point",
            _THE_SAME,
        )
    for tip in tips:
        for joint in reversed(urdf.path_to(tip, None)):
            try:
                found, chain = nominal_chain(urdf, joint.parent, tip, source)
            except InputError:
                continue
            if names in (
                None,
                (),
                tuple(each.name for each in found.joints),
            ) and _is_same(chain, robot.chain):
                return joint.parent, tip
    wanted_joints = ", ".join(names or ()) or format_count(robot.joints, "joint")
    raise InputError(
        source,
        "",
        f"no chain to {wanted!r} by {wanted_joints} as the robot file has it",
        _THE_SAME,
    )


def _is_same(chain: Chain, other: Chain) -> bool:
    """Whether two chains move the same, joint by joint."""
    (fixed, moving), (theirs, their_moving) = _stretches(chain), _stretches(other)
    near = (
        np.abs(mine - wanted).max() < _SAME
        for mine, wanted in zip(fixed, theirs, strict=False)
    )
    return moving == their_moving and all(near)


def _stretches(chain: Chain) -> tuple[list[np.ndarray], list[Transform]]:
    """Fixed transforms (4, 4) before, between and behind those that move; and these."""
    fixed = [np.eye(4)]
    moving = []
    for transform in chain.transforms:
        if transform.coordinate is None:
            fixed[-1] = fixed[-1] @ elementary(
                transform.kind, transform.axis, transform.constant
            )
        else:
            moving.append(transform)
            fixed.append(np.eye(4))
    return fixed, moving


def _origins(
    path: list[Joint], nominal: Robot, calibrated: Robot
) -> dict[str, np.ndarray]:
    """New origins (4, 4) by name of the joint, of those that differ."""
    (before, moving), (after, _) = (
        _stretches(nominal.chain),
        _stretches(calibrated.chain),
    )
    # The URDF's joint values are the nominal angles: what the calibrated ones are where
    # these are 0.
    factor = calibrated.reported_matrix @ np.linalg.inv(nominal.reported_matrix)
    offset = calibrated.reported_offset - factor @ nominal.reported_offset
    found = {}
    here = np.eye(4)
    number = 0
    for joint in path:
        here = here @ joint.origin
        change = np.eye(4)
        moves = joint.kind != "fixed"
        error = np.linalg.inv(before[number]) @ after[number]
        if moves:
            transform = moving[number]
            assert transform.coordinate is not None
            to_chain = np.linalg.inv(here) @ before[number]
            error = error @ elementary(
                transform.kind,
                transform.axis,
                transform.sign * offset[transform.coordinate],
            )
            change = to_chain @ error @ np.linalg.inv(to_chain)
            number = number + 1
            here = homogeneous(express_axis(joint.axis)[-1].T)
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
                element.set(
                    attribute,
                    " ".join(
                        repr(round(float(number), _DECIMALS) + 0.0)
                        for number in numbers
                    ),
                )
    written: bytes = Xml.tostring(root, encoding="utf-8", xml_declaration=True)
    return written + b"\n"
