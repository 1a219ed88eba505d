"""One walk along a chain: the frames of its points, and the screws of all that moves.

Entries of the frame that a chain leaves at 0 or 1 for every configuration stay plain numbers and cost nothing.

The forward recursion of the product of transforms; the axis of a moving one and a point of it make its screw [1].

[1] Murray, R. M., Li, Z. and Sastry, S. S., A Mathematical Introduction to Robotic Manipulation, CRC Press, 1994.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from elastocal.mechanics.products import product, product_difference, product_sum

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from elastocal.mechanics.chain import Chain, MeasuringPoint, Transform

# So many configurations at a time keep all intermediate arrays in a second-level cache.
BLOCK = 8192

# Components of a vector in the base frame, each a number or an ndarray (S,); and the three axes of a frame.
Vector = list[float | np.ndarray]
Axes = list[Vector]


def blocks(size: int) -> list[slice]:
    """Cut so many configurations into blocks of `BLOCK`."""
    return [slice(start, min(start + BLOCK, size)) for start in range(0, size, BLOCK)]


@dataclass(frozen=True, slots=True)
class Screw:
    """A moving transform: its place in the chain, and its axis.

    `place`: how many transforms come before it. `kind`, `sign`, `coordinate`: as of a `Transform`. `axis`: its direction, base
    frame; each component a float or an ndarray (S,). `origin`: a point of it, m; None where points behind it can only turn.
    """

    place: int
    kind: str
    sign: float
    axis: Vector
    origin: Vector | None
    coordinate: int


def sweep(
    chain: Chain, coordinates: np.ndarray, points: Sequence[MeasuringPoint], lines: bool = False
) -> tuple[list[tuple[Axes, Vector]], list[Screw]]:
    """Walk the chain up to the last of the points.

    `coordinates` (C, S): rad and m. `lines`: without, the origin of a screw is None where all points behind lie on the axis and
    only turn; with them the walk goes on to the end of the chain. Returns `frames` (axes, target): of each point, base frame;
    each component a float or an ndarray (S,); `screws`: of each moving transform on the way.
    """
    transforms = chain.transforms if lines else chain.transforms[: max(point.after for point in points)]
    # Springs that no configuration moves cost nothing.
    still = set(np.flatnonzero(~coordinates.any(axis=1)).tolist())
    rotations = [transform for transform in transforms if transform.kind == "R" and transform.coordinate not in still]
    turns = iter(_cosines_and_sines(coordinates, rotations))
    axes: Axes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
    before_turns = axes
    origin: Vector = [0.0, 0.0, 0.0]
    turned_about: int | None = None
    screws = []
    frames = {0: (axes, origin)}
    for number, transform in enumerate(transforms):
        axis, coordinate, sign = transform.axis, transform.coordinate, transform.sign
        if coordinate is not None:
            moves = (
                lines
                or transform.kind == "T"
                or not all(_lies_on(axis, transforms[number : point.after], point) for point in points if point.after > number)
            )
            screws.append(Screw(number, transform.kind, sign, axes[axis], origin if moves else None, coordinate))
        if coordinate in still:
            pass
        elif transform.kind == "T":
            amount = transform.constant if coordinate is None else product(sign, coordinates[coordinate])
            origin = _moved(origin, amount, axes[axis])
        else:
            if axis != turned_about:
                before_turns, turned_about = axes, axis
            axes = _turned(before_turns, axis, *next(turns))
        frames[number + 1] = (axes, origin)
    return [(frames[point.after][0], _offset(*frames[point.after], point.offset_m)) for point in points], screws


def _offset(axes: Axes, origin: Vector, offset_m: Sequence[float]) -> Vector:
    for axis, length in zip(axes, offset_m, strict=True):
        origin = _moved(origin, length, axis)
    return origin


def _lies_on(axis: int, transforms: Sequence[Transform], point: MeasuringPoint) -> bool:
    """Whether transforms along and about one axis are all that lies between this axis and the point."""
    offset = [length for direction, length in enumerate(point.offset_m) if direction != axis]
    return not any(offset) and all(transform.axis == axis for transform in transforms)


def _cosines_and_sines(
    coordinates: np.ndarray, rotations: Sequence[Transform]
) -> list[tuple[float | np.ndarray, float | np.ndarray]]:
    """Cosine and sine of each rotation, counted from the first of those before it that turn about the same axis."""
    angles: list[float | np.ndarray] = []
    turned_about: int | None = None
    for rotation in rotations:
        angle = rotation.constant if rotation.coordinate is None else product(rotation.sign, coordinates[rotation.coordinate])
        angles.append(angles[-1] + angle if rotation.axis == turned_about else angle)
        turned_about = rotation.axis
    moving = iter(_cosines_and_sines_of_arrays([angle for angle in angles if type(angle) is not float], coordinates.shape[1]))
    return [(math.cos(angle), math.sin(angle)) if type(angle) is float else next(moving) for angle in angles]


def _cosines_and_sines_of_arrays(angles: Sequence[float | np.ndarray], size: int) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """By the tangent of half the angle (Weierstrass substitution), which is faster in numpy than either of them."""
    tangent = np.empty((len(angles), size))
    for half, angle in zip(tangent, angles, strict=True):
        np.multiply(0.5, angle, out=half)
    np.tan(tangent, out=tangent)
    scale = tangent * tangent
    scale += 1.0
    np.divide(2.0, scale, out=scale)
    tangent *= scale
    scale -= 1.0
    return zip(scale, tangent, strict=True)


def _turned(axes: Axes, about: int, cosine: float | np.ndarray, sine: float | np.ndarray) -> Axes:
    """Axes of a frame after it has turned about one of them."""
    second, third = axes[about - 2], axes[about - 1]
    axes = list(axes)
    axes[about - 2] = [product_sum(cosine, a, sine, b) for a, b in zip(second, third, strict=True)]
    axes[about - 1] = [product_difference(cosine, b, sine, a) for a, b in zip(second, third, strict=True)]
    return axes


def _moved(origin: Vector, amount: float | np.ndarray, axis: Vector) -> Vector:
    return [product_sum(amount, a, 1.0, o) for o, a in zip(origin, axis, strict=True)]


def store_pose(axes: Axes, origin: Vector, position: np.ndarray, rotation: np.ndarray) -> None:
    """Write a frame of a walk to arrays.

    `axes`, `origin`: as `sweep` gives them. `position` (3, S): overwritten. `rotation` (3, 3, S): overwritten; columns are the
    axes.
    """
    for i in range(3):
        position[i] = origin[i]
        for j in range(3):
            rotation[i, j] = axes[j][i]
