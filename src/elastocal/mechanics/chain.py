"""A chain of elementary transforms with named measuring points, and the notation in
which robot files write it.

The notation is the paper's matrix product written in a line (equations 1-4)::

    Tz(l1) Rz(q1) Tx(l2) Ry(q2) Tx(l3) [2DoF] Ry(q3) ...

``T`` and ``R`` are a translation along and a rotation about x, y or z of the moving
frame. The argument is the name of a length, a joint ``q1 .. qn``, or a number (metres
in ``T``, ``deg`` in ``R``), each with an optional minus sign. ``[NAME]`` marks a
measuring point. ``T.(q3)`` is a prismatic joint: its coordinate, limits and offset are
in metres, and its compliance is in µm/N. Each joint occurs once, in rising order.

Such a product is an elementary transform sequence [1].

References
----------
[1] Corke, P. I., A simple and systematic approach to assigning Denavit-Hartenberg
    parameters, IEEE Transactions on Robotics 23, 2007.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from elastocal.errors import InputError, find_text_fault

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

AXES = "xyz"
# Candidates grow with the square of the joints: with 40 joints `elastocal check` took
# 1.9 GB. No arm has as many joints.
MOST_JOINTS = 32
# Kind and axis of the six elementary displacements of a frame: Tx Ty Tz Rx Ry Rz.
SIX_DISPLACEMENTS = tuple((kind, axis) for kind in "TR" for axis in range(3))
_TOKEN = re.compile(
    r"(?P<kind>[TR])(?P<axis>[xyz])\((?P<sign>-?)(?P<argument>[^()\s-]+)\)"
    r"|\[(?P<point>[^\[\]\s]+)\]"
)
_NUMBER = re.compile(r"\d+(\.\d*)?|\.\d+")
_NOTATION = (
    "Tx(length) Ty(..) Tz(..) Rx(joint) Ry(..) Rz(..) Rx(90deg) and [POINT], "
    "separated by blanks"
)


@dataclass(frozen=True)
class Transform:
    """One elementary transform along or about an axis of the moving frame.

    Attributes
    ----------
    kind : "T" for a translation (m), "R" for a rotation (rad)
    axis : 0, 1, 2 for x, y, z
    constant : amount of a fixed transform, m or rad
    coordinate : int, optional
        Index of the coordinate that moves the transform: a joint, or a spring of the
        extended model. None for a fixed transform.
    sign : sense of the coordinate, +1 or -1
    """

    kind: str
    axis: int
    constant: float = 0.0
    coordinate: int | None = None
    sign: float = 1.0


@dataclass(frozen=True)
class MeasuringPoint:
    """A point of the chain where a target sits.

    Attributes
    ----------
    name : name in brackets
    after : number of transforms of the chain before the point
    offset_m : target in the frame of the point (the paper's T_tool without rotation)
    """

    name: str
    after: int
    offset_m: tuple[float, ...] = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Chain:
    """Elementary transforms from the base to the last measuring point.

    Attributes
    ----------
    transforms : from the base on
    points : in the order of the chain; the last one is the end-effector
    coordinates : number of coordinates that move transforms
    """

    transforms: tuple[Transform, ...]
    points: tuple[MeasuringPoint, ...]
    coordinates: int

    @property
    def end_effector(self) -> MeasuringPoint:
        """The last measuring point, to which the external wrench refers."""
        return self.points[-1]

    def at(self, joint_angles: np.ndarray) -> np.ndarray:
        """Return coordinates (..., C) that begin with joint angles (..., n) and are
        zero otherwise."""
        coordinates = np.zeros((*joint_angles.shape[:-1], self.coordinates))
        coordinates[..., : joint_angles.shape[-1]] = joint_angles
        return coordinates

    def point(self, name: str) -> MeasuringPoint:
        """Return the measuring point with a name; a KeyError lists the known names."""
        for point in self.points:
            if point.name == name:
                return point
        names = ", ".join(point.name for point in self.points)
        raise KeyError(f"measuring point {name!r}; the chain has {names}")

    def moved_by(self, point: MeasuringPoint) -> tuple[int, ...]:
        """Return the coordinates before a point, which are those that can move it."""
        return tuple(
            transform.coordinate
            for transform in self.transforms[: point.after]
            if transform.coordinate is not None
        )

    @property
    def prismatic(self) -> tuple[bool, ...]:
        """Whether each coordinate is a translation."""
        translations = {
            transform.coordinate
            for transform in self.transforms
            if transform.kind == "T"
        }
        return tuple(index in translations for index in range(self.coordinates))


def insert_coordinates(
    chain: Chain, insertions: Mapping[int, Sequence[tuple[str, int]]]
) -> Chain:
    """Insert further coordinates, such as springs or errors of lengths.

    Parameters
    ----------
    chain : chain without them
    insertions : mapping
        Kind and axis of the coordinates to insert, by the number of transforms before
        them. A measuring point at the same position comes behind them.

    Returns
    -------
    Chain
        The coordinates of `chain` keep their indices; the inserted ones follow in
        their order along the chain.
    """
    transforms: list[Transform] = []
    coordinate = chain.coordinates
    new_index = {}
    for index in range(len(chain.transforms) + 1):
        for kind, axis in insertions.get(index, ()):
            transforms.append(Transform(kind, axis, 0.0, coordinate))
            coordinate += 1
        new_index[index] = len(transforms)
        transforms += chain.transforms[index : index + 1]
    points = tuple(
        replace(point, after=new_index[point.after]) for point in chain.points
    )
    return Chain(tuple(transforms), points, coordinate)


def parse_chain(text: str, lengths_m: Mapping[str, float], source: str) -> Chain:
    """Parse the chain notation.

    Parameters
    ----------
    text : notation as in the module's docstring
    lengths_m : named lengths
    source : name of the file for errors

    Raises
    ------
    InputError
        For a token outside the notation, an unknown or unused length, joints that are
        not q1..qn in order, no measuring point at the end, or one that occurs twice.
    """
    transforms: list[Transform] = []
    points: dict[str, MeasuringPoint] = {}
    used_lengths: set[str] = set()
    joints = 0
    for token in text.split():
        match = _TOKEN.fullmatch(token)
        if not match:
            raise InputError(source, "chain", repr(token), _NOTATION)
        name = match["point"]
        if name:
            if name in points:
                allowed = "each measuring point once"
                raise InputError(source, "chain", f"[{name}] twice", allowed)
            if fault := find_text_fault(name):
                raise InputError(source, "chain", *fault)
            points[name] = MeasuringPoint(name, len(transforms))
            continue
        transform = _parse_transform(match, joints, lengths_m, source)
        transforms.append(transform)
        joints += transform.coordinate is not None
        if transform.kind == "T":
            used_lengths.add(match["argument"])
    if not 1 <= joints <= MOST_JOINTS:
        number = f"{joints} joints" if joints else "no joint"
        allowed = f"at least one R.(q1) or T.(q1), and {MOST_JOINTS} joints at most"
        raise InputError(source, "chain", number, allowed)
    chain = Chain(tuple(transforms), tuple(points.values()), joints)
    if not points or chain.end_effector.after != len(transforms):
        last = f"{text.split()[-1]!r} at its end"
        allowed = "a measuring point such as [6DoF] at the end"
        raise InputError(source, "chain", last, allowed)
    if unused := sorted(set(lengths_m) - used_lengths):
        allowed = "lengths that the chain uses"
        raise InputError(source, "lengths_m", ", ".join(unused), allowed)
    return chain


def _parse_transform(
    match: re.Match[str], joint: int, lengths_m: Mapping[str, float], source: str
) -> Transform:
    """Parse a matched `_TOKEN`, whose argument is a constant or the next joint, given
    by its index."""
    kind = match["kind"]
    axis = AXES.index(match["axis"])
    argument = match["argument"]
    sign = -1.0 if match["sign"] else 1.0
    if kind == "T" and argument in lengths_m:
        return Transform(kind, axis, sign * lengths_m[argument])
    if kind == "T" and _NUMBER.fullmatch(argument):
        return Transform(kind, axis, sign * float(argument))
    degrees = argument.removesuffix("deg")
    if kind == "R" and degrees != argument and _NUMBER.fullmatch(degrees):
        return Transform(kind, axis, sign * math.radians(float(degrees)))
    if argument == f"q{joint + 1}":
        return Transform(kind, axis, 0.0, joint, sign)
    constants = "degrees such as 90deg"
    if kind == "T":
        constants = f"{', '.join(lengths_m)} or metres"
    allowed = f"in {kind}{match['axis']}(): q{joint + 1} or {constants}"
    raise InputError(source, "chain", repr(match[0]), allowed)


def format_chain(chain: Chain) -> str:
    """Write a chain in the notation that `parse_chain` reads, with its lengths as
    numbers."""
    tokens = []
    for index in range(len(chain.transforms) + 1):
        tokens += [f"[{point.name}]" for point in chain.points if point.after == index]
        for transform in chain.transforms[index : index + 1]:
            sign = transform.sign
            amount = abs(transform.constant)
            if transform.coordinate is not None:
                argument = f"q{transform.coordinate + 1}"
            else:
                sign = math.copysign(1.0, transform.constant)
                unit = ""
                if transform.kind == "R":
                    amount = math.degrees(amount)
                    unit = "deg"
                argument = f"{np.format_float_positional(amount, trim='-')}{unit}"
            minus = "-" if sign < 0 else ""
            tokens.append(f"{transform.kind}{AXES[transform.axis]}({minus}{argument})")
    return " ".join(tokens)
