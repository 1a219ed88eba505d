"""A user's own URDF with the joint origins of a calibrated robot: every other byte of the file stays as it is.

Between two joints that move, the calibrated chain has a fixed transform that differs from the nominal one by a displacement E
at its end, and an offset of the joint is a turn R about (or a shift along) its axis. With G from a joint's frame to the chain's
before it moves, its origin O becomes O G E R G^-1; what lies behind the last joint goes into the last fixed joint. Joint values
are those of the URDF, before and after.
"""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from xml.parsers import expat

import numpy as np

from elastocal.counting import counted
from elastocal.errors import InputError
from elastocal.exchange.fixed_transforms import axis_rotation, elementary, yaw_pitch_roll
from elastocal.exchange.urdf_chain import UrdfChain, chain_between, path_to, point_name
from elastocal.exchange.urdf_reading import LARGEST_BYTES, Joint, Urdf, read_urdf
from elastocal.io.texts import read_bytes
from elastocal.mechanics.chain import Chain, Transform, parse_chain
from elastocal.mechanics.robot import Robot

# m and rad: of rounding, in a file or in a product of transforms.
_SAME, _DECIMALS = 1e-9, 12
_THE_SAME = "the URDF from which the robot file was imported"
_TAG = re.compile(rb"""<[^\s>/]+(?:\s+[^\s=>]+\s*=\s*(?:"[^"]*"|'[^']*'))*\s*(?=/?>)""")


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
    An `InputError` refuses another robot's file, naming the joint, and one that is not in a superset of ASCII.
    """
    source = Path(path).as_posix()
    content = read_bytes(path, LARGEST_BYTES, "a URDF file")
    urdf = read_urdf(path)
    if b"\0" in content:
        raise InputError(source, "", "UTF-16 or UTF-32", "a URDF in UTF-8, or in another encoding that has ASCII as it is")
    base, tip = _ends_of(urdf, nominal, source)
    origins = _origins(path_to(urdf, tip, base), nominal, calibrated)
    return CorrectedUrdf(_edit(content, origins), len(origins), base, tip)


def nominal_chain(urdf: Urdf, base: str, tip: str, source: str) -> tuple[UrdfChain, Chain]:
    """The chain between two links, and the same as `mechanics` has it."""
    found = chain_between(urdf, base, tip, (), source)
    return found, parse_chain(found.notation, {}, source)


def _ends_of(urdf: Urdf, robot: Robot, source: str) -> tuple[str, str]:
    """Base and tip between which the file has the robot's chain."""
    wanted, names = robot.chain.end_effector.name, robot.joint_names
    tips = [link.name for link in urdf.links if point_name(link.name) == wanted]
    if not tips:
        raise InputError(source, "", f"no link {wanted!r}, the robot's last measuring point", _THE_SAME)
    faults = []
    for tip in tips:
        for joint in reversed(path_to(urdf, tip, None)):
            try:
                found, chain = nominal_chain(urdf, joint.parent, tip, source)
            except InputError:
                continue
            joints = [each.name for each in found.joints]
            if len(joints) != robot.joints or (names and tuple(joints) != names):
                continue
            fault = _difference(chain, robot.chain, joints)
            if fault is None:
                return joint.parent, tip
            faults.append(fault)
    if not faults:
        listed = ", ".join(names or ()) or counted(robot.joints, "joint")
        raise InputError(source, "", f"no chain to {wanted!r} by {listed}", _THE_SAME)
    # Of another base all is the same behind the first joint.
    raise InputError(source, *max(faults)[1:], _THE_SAME)


def _difference(chain: Chain, other: Chain, names: list[str]) -> tuple[int, str, str] | None:
    """The first joint (or the tip) that two chains have differently: its number, name and how; None where they are the same."""
    (fixed, moving), (theirs, their_moving) = _stretches(chain), _stretches(other)
    if len(moving) != len(their_moving):
        return 0, "", f"{counted(len(moving), 'joint that moves', 'joints that move')}, not {len(their_moving)}"
    for number, (mine, wanted) in enumerate(zip(fixed, theirs, strict=True)):
        last = number == len(moving)
        key = "the tip" if last else f"joint {names[moving[number].coordinate or 0]!r}"
        off = np.linalg.inv(wanted) @ mine
        turned = float(np.arccos(np.clip((np.trace(off[:3, :3]) - 1.0) / 2.0, -1.0, 1.0)))
        if np.abs(off - np.eye(4)).max() > _SAME:
            far = 1e3 * float(np.linalg.norm(off[:3, 3]))
            return number, key, f"{far:.4g} mm and {np.degrees(turned):.4g} deg from where the robot file has it"
        if not last and moving[number] != their_moving[number]:
            return number, key, "another axis than in the robot file"
    return None


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
            number, here = number + 1, np.eye(4)
            here[:3, :3] = axis_rotation(joint.axis).T
        elif joint is path[-1]:
            change = error
        if np.abs(change - np.eye(4)).max() > 10.0**-_DECIMALS:
            found[joint.name] = joint.origin @ change
    return found


def _edit(content: bytes, origins: Mapping[str, np.ndarray]) -> bytes:
    """The file with other origins: nothing but the values of xyz and rpy is written anew."""
    parts, done = [], 0
    for start, tag, name in _places(content):
        if name not in origins:
            continue
        end, begin, close = start + len(tag), start, b""
        if tag[1:].split(None, 1)[0].rpartition(b":")[2] != b"origin":
            # The joint's own tag, behind which an origin is written.
            begin = end = content.index(b">", end) + 1
            tag, close = b"<origin", b"/>"
        values = {b"xyz": origins[name][:3, 3], b"rpy": np.array(yaw_pitch_roll(origins[name][:3, :3]))[::-1]}
        for attribute, numbers in values.items():
            tag = _set_attribute(tag, attribute, _words(numbers))
        parts += [content[done:begin], tag, close]
        done = end
    return b"".join([*parts, content[done:]])


def _set_attribute(tag: bytes, name: bytes, value: bytes) -> bytes:
    pattern = re.compile(rb"(\s" + name + rb"\s*=\s*)(?:\"[^\"]*\"|'[^']*')")
    new, count = pattern.subn(lambda found: found[1] + b'"' + value + b'"', tag, count=1)
    return new if count else tag.rstrip() + b' %b="%b"' % (name, value)


def _words(values: np.ndarray) -> bytes:
    return " ".join(repr(round(float(value), _DECIMALS) + 0.0) for value in values).encode("ascii")


def _places(content: bytes) -> Iterator[tuple[int, bytes, str]]:
    """Of each joint below the root: where the tag of its origin begins, or its own where it has none; the tag; its name."""
    parser, depth = expat.ParserCreate(), 0
    found: list[tuple[int, str]] = []

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal depth
        depth += 1
        plain = tag.rpartition(":")[2]
        if depth == 2:
            inside[:] = [attributes["name"]] if plain == "joint" else []
        if inside and (depth == 2 or (depth == 3 and plain == "origin")):
            if depth == 3:
                found.pop()
            found.append((parser.CurrentByteIndex, inside[0]))

    def end(_: str) -> None:
        nonlocal depth
        depth -= 1

    inside: list[str] = []
    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.Parse(content, True)
    for place, name in found:
        tag = _TAG.match(content, place)
        assert tag is not None
        yield place, tag[0], name
