"""The serial chain between two links of a URDF, in the notation of `mechanics.chain`.

A joint of a URDF is a fixed transform (``origin``), and then a rotation about or a translation along an axis. The transform
becomes ``Tx Ty Tz Rz Ry Rx``; an axis that is not x, y or z is turned into z and back, ``Rz Ry Rz(q1) Ry Rz``. A joint that
mimics another one of the chain, by +1 or -1, stands in the chain as a passive joint ``Ry(-q2)``.
"""

import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import takewhile

import numpy as np

from elastocal.errors import InputError, closest_first
from elastocal.exchange.fixed_transforms import (
    axis_rotation,
    displacement_words,
    elementary,
    express_axis,
    shift_word,
    turn_word,
)
from elastocal.exchange.urdf_reading import Joint, Urdf

# Of a shorter one the direction is no more than rounding.
_SHORTEST_AXIS = 1e-9
_MOVING = {"revolute": "R", "continuous": "R", "prismatic": "T"}


@dataclass(frozen=True)
class Carried:
    """Where a link of the chain is.

    `body`: number of the joint that carries it, 0 for the column. `transform` (4, 4): of its frame, in the frame directly
    behind that joint, all joints at zero. `behind_passive`: whether a passive joint turns it against that joint's frame.
    """

    body: int
    transform: np.ndarray
    behind_passive: bool


@dataclass(frozen=True)
class UrdfChain:
    """The chain between two links.

    `notation`: with measuring points, in a line. `joints`: those of q1, q2, ... `links`: links on the chain.
    """

    notation: str
    joints: tuple[Joint, ...]
    links: dict[str, Carried]


def parent_joints(urdf: Urdf) -> dict[str, Joint]:
    """The joint above each link, by the link's name; the root has none."""
    return {joint.child: joint for joint in urdf.joints}


def joints_above(urdf: Urdf, link: str) -> Iterator[Joint]:
    """The joints that carry a link, the nearest first, to the root."""
    above = parent_joints(urdf)
    while link in above:
        yield above[link]
        link = above[link].parent


def path_to(urdf: Urdf, tip: str, base: str | None) -> list[Joint]:
    """The joints from a link, or from the root of the tree where it does not carry the tip, to the tip."""
    return [*takewhile(lambda joint: joint.child != base, joints_above(urdf, tip))][::-1]


def chain_between(urdf: Urdf, base: str, tip: str, points: Sequence[str], source: str) -> UrdfChain:
    """The chain from one link to another that it carries.

    `base`, `tip`: names of links. `points`: further links of the chain that become measuring points; the tip is the last one
    always. `source`: named in errors. Raises `InputError`: a link that is not there or not on the chain, a tip that the base
    does not carry, a joint that the notation cannot say.
    """
    path = _path(urdf, base, tip, source)
    masters = _masters(urdf, path, source)
    on_chain = [base, *(joint.child for joint in path)]
    for name in points:
        if name not in on_chain:
            allowed = f"a link between {base!r} and {tip!r}: {closest_first(name, on_chain)}"
            raise InputError(source, "point", repr(name), allowed)
    marked = {name: point_name(name) for name in (*points, tip)}
    if len(set(marked.values())) < len(marked):
        allowed = "links whose names differ by more than blanks and brackets"
        raise InputError(source, "point", ", ".join(map(repr, marked)), allowed)
    words = [f"[{marked[base]}]"] if base in marked else []
    numbers: dict[str, int] = {}
    place = Carried(0, np.eye(4), False)
    links = {base: place}
    for joint in path:
        words += displacement_words(joint.origin)
        place = Carried(place.body, place.transform @ joint.origin, place.behind_passive)
        if joint.name in masters:
            moved, place = _write_joint(joint, *masters[joint.name], numbers, place, source)
            words += moved
        if joint.child in marked:
            words.append(f"[{marked[joint.child]}]")
        links[joint.child] = place
    named = {joint.name: joint for joint in path}
    return UrdfChain(" ".join(words), tuple(named[name] for name in numbers), links)


def point_name(link: str) -> str:
    """A link's name as that of a measuring point: blanks and brackets, which the notation needs, become underscores."""
    return re.sub(r"[\[\]\s]", "_", link)


def _write_joint(
    joint: Joint, master: str, sign: float, offset: float, numbers: dict[str, int], place: Carried, source: str
) -> tuple[list[str], Carried]:
    """Words of a joint that moves, and where it carries what is behind it."""
    axis = joint.axis
    if not np.linalg.norm(axis) > _SHORTEST_AXIS:
        raise InputError(source, f"joint {joint.name!r}: axis xyz", " ".join(f"{part:g}" for part in axis), "a direction")
    kind = _MOVING[joint.kind]
    before, letter, minus, after = express_axis(axis)
    negative = (minus == "-") != (sign < 0)
    fixed = (turn_word if kind == "R" else shift_word)(letter, -offset if minus else offset)
    passive = master in numbers
    number = numbers.setdefault(master, len(numbers) + 1)
    words = [*before, *([fixed] if fixed else []), f"{kind}{letter}({'-' if negative else ''}q{number})", *after]
    turn = np.eye(4)
    turn[:3, :3] = axis_rotation(axis)
    if not passive:
        return words, Carried(number, turn.T, False)
    step = elementary(kind, "xyz".index(letter), -offset if minus else offset)
    return words, Carried(place.body, place.transform @ turn @ step @ turn.T, place.behind_passive or kind == "R")


def _path(urdf: Urdf, base: str, tip: str, source: str) -> list[Joint]:
    names = [link.name for link in urdf.links]
    for key, name in (("base", base), ("tip", tip)):
        if name not in names:
            raise InputError(source, key, repr(name), f"a link: {closest_first(name, names)}")
    path = path_to(urdf, tip, base)
    if base != (path[0].parent if path else tip):
        raise InputError(source, f"base {base!r}, tip {tip!r}", _relation(urdf, base, tip), "a tip that the base carries")
    if not any(joint.kind in _MOVING for joint in path):
        raise InputError(source, f"base {base!r}, tip {tip!r}", "no joint that moves between them", "links with joints between")
    for joint in path:
        if joint.kind not in (*_MOVING, "fixed"):
            raise InputError(source, f"joint {joint.name!r}", f"type {joint.kind}", " | ".join((*_MOVING, "fixed")))
    return path


def _relation(urdf: Urdf, base: str, tip: str) -> str:
    if any(joint.parent == tip for joint in joints_above(urdf, base)):
        return "a base that the tip carries (give them the other way round)"
    return "two branches of the tree"


def _masters(urdf: Urdf, path: Sequence[Joint], source: str) -> dict[str, tuple[str, float, float]]:
    """By name of each joint that moves: the joint of the chain whose coordinate it has, +1 or -1 of it, and an offset."""
    every = {joint.name: joint for joint in urdf.joints}
    kinds = {joint.name: _MOVING[joint.kind] for joint in path if joint.kind in _MOVING}
    masters = {}
    for name in kinds:
        master, factor, offset, seen = name, 1.0, 0.0, {name}
        while (mimic := every[master].mimic) is not None:
            called = f"joint {master!r}: mimic"
            if mimic.joint not in kinds:
                raise InputError(source, called, repr(mimic.joint), f"a joint that moves in the chain: {', '.join(kinds)}")
            if mimic.joint in seen:
                raise InputError(source, called, f"a loop back to {mimic.joint!r}", "a joint that mimics no other in the end")
            factor, offset = factor * mimic.multiplier, offset + factor * mimic.offset
            master = mimic.joint
            seen.add(master)
        if abs(factor) != 1.0 or kinds[master] != kinds[name]:
            found = f"{factor:g} times {master!r}" if kinds[master] == kinds[name] else f"{master!r}, which moves otherwise"
            raise InputError(source, f"joint {name!r}: mimic", found, "a joint of the same type with multiplier 1 or -1")
        masters[name] = (master, math.copysign(1.0, factor), offset)
    return masters
