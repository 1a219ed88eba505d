"""A chain of elementary transforms with named measuring points, and the notation in
which it is written.

The chain notation is the paper's matrix product written in a line (equations 1-4)::

    Tz(l1) Rz(q1) Tx(l2) Ry(q2) Tx(l3) [2DoF] Ry(q3) ...

``T`` and ``R`` are a translation along and a rotation about x, y or z of the moving
frame; the argument is the name of a length, a joint ``q1 .. qn``, or a number (metres
in ``T``, ``deg`` in ``R``), each with an optional minus sign; ``[NAME]`` marks a
measuring point. ``T.(q3)`` is a prismatic joint: its coordinate is in metres, and so
are its limits and its offset; its compliance is in µm/N. Each joint stands in one
place, in order.

Such a product is an elementary transform sequence [1].

[1] Corke, P. I., A simple and systematic approach to assigning Denavit-Hartenberg parameters, IEEE Transactions on Robotics 23,
    2007.
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
# Kind and axis of all ways in which a frame can move.
SIX_DISPLACEMENTS = tuple((kind, axis) for kind in "TR" for axis in range(3))
_TOKEN = re.compile(
    r"(?P<kind>[TR])(?P<axis>[xyz])\((?P<sign>-?)(?P<argument>[^()\s-]+)\)|\[(?P<point>[^\[\]\s]+)\]"
)
_NUMBER = re.compile(r"\d+(\.\d*)?|\.\d+")
_NOTATION = "Tx(length) Ty(..) Tz(..) Rx(joint) Ry(..) Rz(..) Rx(90deg) and [POINT], separated by blanks"


@dataclass(frozen=True)
class Transform:
    """One elementary transform along or about an axis of the moving frame, fixed or
    moved by a coordinate.

    `kind`: translation (m) or rotation (rad). `axis`: 0, 1, 2 for x, y, z. `constant`:
    how far, where it is fixed (m or rad). `coordinate`: index of the coordinate that
    says how far, where it moves: a joint, or a spring of the extended model. `sign`:
    sense of the coordinate, +1 or -1.
    """

    kind: str
    axis: int
    constant: float = 0.0
    coordinate: int | None = None
    sign: float = 1.0


@dataclass(frozen=True)
class MeasuringPoint:
    """A place on the chain where a target sits.

    `after`: how many transforms of the chain come before it. `offset_m`: the target in
    the frame of the point (the paper's T_tool, without rotation).
    """

    name: str
    after: int
    offset_m: tuple[float, ...] = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Chain:
    """Elementary transforms from the base to the last measuring point.

    `points`: in the order of the chain; the last one is the end-effector.
    `coordinates`: number of coordinates that the transforms refer to.
    """

    transforms: tuple[Transform, ...]
    points: tuple[MeasuringPoint, ...]
    coordinates: int

    @property
    def end_effector(self) -> MeasuringPoint:
        """The last measuring point, where the external wrench is stated."""
        return self.points[-1]

    def at(self, joint_angles: np.ndarray) -> np.ndarray:
        """Coordinates where the first of them are the joint angles (..., n) and all
        others zero, ndarray (..., C)."""
        coordinates = np.zeros((*joint_angles.shape[:-1], self.coordinates))
        coordinates[..., : joint_angles.shape[-1]] = joint_angles
        return coordinates

    def point(self, name: str) -> MeasuringPoint:
        """The measuring point called `name`; KeyError names those there are."""
        for point in self.points:
            if point.name == name:
                return point
        raise KeyError(
            f"measuring point {name!r}; the chain has {', '.join(p.name for p in self.points)}"
        )

    def moved_by(self, point: MeasuringPoint) -> tuple[int, ...]:
        """Indices of the coordinates before `point`: those that can move it."""
        return tuple(
            t.coordinate
            for t in self.transforms[: point.after]
            if t.coordinate is not None
        )

    @property
    def prismatic(self) -> tuple[bool, ...]:
        """Whether each coordinate is a shift and not a turn, tuple of bool."""
        kinds = {
            t.coordinate: t.kind == "T"
            for t in self.transforms
            if t.coordinate is not None
        }
        return tuple(
            kinds.get(coordinate, False) for coordinate in range(self.coordinates)
        )


def insert_coordinates(
    chain: Chain, inserted: Mapping[int, Sequence[tuple[str, int]]]
) -> Chain:
    """A chain with further coordinates, such as springs or errors of lengths.

    `inserted` (kind, axis): how many transforms of the chain come before them, and what
    moves; measuring points there come after them. Returns coordinates as before, then
    the inserted ones in their order along the chain.
    """
    transforms: list[Transform] = []
    count = chain.coordinates
    new_index = {}
    for index in range(len(chain.transforms) + 1):
        for kind, axis in inserted.get(index, ()):
            transforms.append(Transform(kind, axis, 0.0, count))
            count += 1
        new_index[index] = len(transforms)
        transforms += chain.transforms[index : index + 1]
    points = tuple(
        replace(point, after=new_index[point.after]) for point in chain.points
    )
    return Chain(tuple(transforms), points, count)


def parse_chain(text: str, lengths_m: Mapping[str, float], source: str) -> Chain:
    """Read the chain notation.

    `text`: the chain, as in the module's docstring. `lengths_m`: named lengths.
    `source`: named in errors. Raises `InputError`: a token outside the notation, an
    unknown or unused length, joints that are not q1..qn in order, no measuring point, a
    measuring point named twice.
    """
    transforms: list[Transform] = []
    points: list[MeasuringPoint] = []
    used: set[str] = set()
    joints = 0
    for word in text.split():
        token = _TOKEN.fullmatch(word)
        if not token:
            raise InputError(source, "chain", repr(word), _NOTATION)
        if token["point"]:
            if token["point"] in {p.name for p in points}:
                raise InputError(
                    source,
                    "chain",
                    f"[{token['point']}] twice",
                    "each measuring point once",
                )
            if fault := find_text_fault(token["point"]):
                raise InputError(source, "chain", *fault)
            points.append(MeasuringPoint(token["point"], len(transforms)))
            continue
        kind = token["kind"]
        axis = AXES.index(token["axis"])
        argument = token["argument"]
        sign = -1.0 if token["sign"] else 1.0
        number = argument.removesuffix("deg") if kind == "R" else argument
        if kind == "T" and argument in lengths_m:
            used.add(argument)
            transforms.append(Transform(kind, axis, sign * lengths_m[argument]))
        elif _NUMBER.fullmatch(number) and (kind == "T" or argument.endswith("deg")):
            value = float(number)
            transforms.append(
                Transform(
                    kind, axis, sign * (value if kind == "T" else math.radians(value))
                )
            )
        elif argument == f"q{joints + 1}":
            transforms.append(Transform(kind, axis, 0.0, joints, sign))
            joints += 1
        else:
            others = (
                "degrees such as 90deg"
                if kind == "R"
                else f"{', '.join(lengths_m)} or metres"
            )
            raise InputError(
                source,
                "chain",
                repr(word),
                f"in {kind}{token['axis']}(): q{joints + 1} or {others}",
            )
    if not joints:
        raise InputError(source, "chain", "no joint", "at least one R.(q1) or T.(q1)")
    if not points or points[-1].after != len(transforms):
        raise InputError(
            source,
            "chain",
            f"{text.split()[-1]!r} at its end",
            "a measuring point such as [6DoF] at the end",
        )
    if unused := sorted(set(lengths_m) - used):
        raise InputError(
            source, "lengths_m", ", ".join(unused), "lengths that the chain uses"
        )
    return Chain(tuple(transforms), tuple(points), joints)


def format_chain(chain: Chain) -> str:
    """A chain in the notation that `parse_chain` reads, with its lengths as numbers."""
    words = []
    for place in range(len(chain.transforms) + 1):
        words += [f"[{point.name}]" for point in chain.points if point.after == place]
        for moved in chain.transforms[place : place + 1]:
            sign = moved.sign
            argument = f"q{(moved.coordinate or 0) + 1}"
            if moved.coordinate is None:
                sign = math.copysign(1.0, moved.constant)
                amount = abs(moved.constant)
                turns = moved.kind == "R"
                number = np.format_float_positional(
                    math.degrees(amount) if turns else amount, trim="-"
                )
                argument = f"{number}deg" if turns else number
            words.append(
                f"{moved.kind}{AXES[moved.axis]}({'-' if sign < 0 else ''}{argument})"
            )
    return " ".join(words)
