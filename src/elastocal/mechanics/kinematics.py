"""Equations 1-4: poses of any measuring point by elementary transforms, its geometric Jacobian by screws; batched.

Arrays come and go with the batch in front, ``(..., 6, n)``, but lie in memory component first, so that every arithmetic step
runs along the batch; slices such as ``jacobian[..., 0, 2]`` are contiguous.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from elastocal.mechanics.chain import MeasuringPoint

if TYPE_CHECKING:
    from collections.abc import Sequence

    from elastocal.mechanics.chain import Chain, Transform

    # The three axes of a frame and its origin in base axes: each (3, S), or (3, 1) before any coordinate has moved it.
    Frame = tuple[list[np.ndarray], np.ndarray]

# So many configurations at a time keep all intermediate arrays in a second-level cache.
BLOCK = 8192


def blocks(size: int) -> list[slice]:
    """Cut so many configurations into blocks of `BLOCK`."""
    return [slice(start, min(start + BLOCK, size)) for start in range(0, size, BLOCK)]


def walk(chain: Chain, coordinates: np.ndarray, until: int) -> list[Frame]:
    """Frames along a chain: before each of so many transforms, and behind the last of them.

    `coordinates` (C, S): rad and m. The forward recursion of the product of transforms; turns that follow one another about one
    axis are one turn by the sum of their angles.
    """
    axes, origin = list(np.eye(3)[:, :, None]), np.zeros((3, 1))
    before, about, angle = axes, None, 0.0
    frames = [(axes, origin)]
    coordinates = np.ascontiguousarray(coordinates)
    # Springs that no configuration moves cost nothing.
    rest = np.logical_not(coordinates.any(axis=1))
    for transform in chain.transforms[:until]:
        axis, driven = transform.axis, transform.coordinate
        if driven is None or not rest[driven]:
            amount = transform.constant if driven is None else coordinates[driven]
            if transform.sign < 0:
                amount = -amount
            if transform.kind == "T":
                origin = origin + amount * axes[axis]
            else:
                before, angle = (before, angle + amount) if axis == about else (axes, amount)
                axes, about = _turn(before, axis, angle), axis
        frames.append((axes, origin))
    return frames


def place_point(frames: Sequence[Frame], point: MeasuringPoint) -> Frame:
    """The frame of a measuring point, by the frames of `walk` up to it at least."""
    axes, origin = frames[point.after]
    for axis, length in zip(axes, point.offset_m, strict=True):
        if length:
            origin = origin + length * axis
    return axes, origin


def _turn(axes: list[np.ndarray], about: int, angle: float | np.ndarray) -> list[np.ndarray]:
    """Axes of a frame after it has turned about one of them."""
    cosine, sine = (math.cos(angle), math.sin(angle)) if isinstance(angle, float) else _cosine_and_sine(angle)
    second, third = axes[about - 2], axes[about - 1]
    turned = list(axes)
    turned[about - 2], turned[about - 1] = cosine * second + sine * third, cosine * third - sine * second
    return turned


def _cosine_and_sine(angle: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """By the tangent of half the angle (Weierstrass substitution), which is faster in numpy than either of them."""
    tangent = np.tan(0.5 * angle)
    scale = tangent * tangent
    scale += 1.0
    np.divide(2.0, scale, out=scale)
    tangent *= scale
    scale -= 1.0
    return scale, tangent


def poses(chain: Chain, coordinates: np.ndarray, point: MeasuringPoint) -> tuple[np.ndarray, np.ndarray]:
    """Position and orientation of a measuring point in the base frame (equations 1-4).

    `coordinates` (..., n): joint angles in rad (and springs of an extended chain in m or rad). Returns `position` (..., 3): m,
    base frame; `rotation` (..., 3, 3): columns are the axes of the point's frame in base axes.
    """
    position, rotation = poses_of_points(chain, coordinates, [point])
    return position[0], rotation[0]


def poses_of_points(chain: Chain, coordinates: np.ndarray, points: Sequence[MeasuringPoint]) -> tuple[np.ndarray, np.ndarray]:
    """Poses of several measuring points in one walk along the chain.

    `chain`, `coordinates`: as in `poses`. Returns `position` (T, ..., 3); `rotation` (T, ..., 3, 3).
    """
    components, batch = _component_first(coordinates)
    size = components.shape[1]
    position, rotation = np.empty((len(points), 3, size)), np.empty((len(points), 3, 3, size))
    for part in blocks(size):
        frames = walk(chain, components[:, part], max(point.after for point in points))
        for number, point in enumerate(points):
            store_pose(place_point(frames, point), position[number, :, part], rotation[number, :, :, part])
    return _batch_first(position, batch, 1), _batch_first(rotation, batch, 1)


def corners(chain: Chain, coordinates: np.ndarray) -> np.ndarray:
    """Where an arm has corners: at its base and behind each translation.

    `chain`, `coordinates`: as in `poses`. Returns (K, ..., 3): m, base axes.
    """
    places = [0, *(number + 1 for number, transform in enumerate(chain.transforms) if transform.kind == "T")]
    return poses_of_points(chain, coordinates, [MeasuringPoint(str(place), place) for place in places])[0]


def joint_axes(chain: Chain, coordinates: np.ndarray) -> np.ndarray:
    """Where each joint turns or slides, and about or along which axis.

    `chain`, `coordinates`: as in `poses`. Returns (J, 2, ..., 3): a place on the axis in m and its direction, base axes.
    """
    moved = [number for number, t in enumerate(chain.transforms) if t.coordinate is not None and not chain.is_passive(number)]
    position, rotation = poses_of_points(chain, coordinates, [MeasuringPoint(str(number), number) for number in moved])
    axes = np.stack([turned[..., chain.transforms[number].axis] for number, turned in zip(moved, rotation, strict=True)])
    return np.stack([position, axes], axis=1)


def poses_and_jacobians(
    chain: Chain, coordinates: np.ndarray, point: MeasuringPoint
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Pose of a measuring point and its geometric Jacobian with respect to every coordinate of the chain.

    `coordinates` (..., n): joint angles in rad (and springs of an extended chain in m or rad). Returns
    `position` (..., 3): m, base frame; `rotation` (..., 3, 3); `jacobian` (..., 6, n): rows: linear velocity of the point (m
    per unit of coordinate), angular velocity (rad per unit), base axes. Columns of coordinates behind the point are zero.

    The twist of a revolute coordinate with axis z through o is (z x (p - o), z), of a prismatic one (z, 0): the columns of the
    geometric Jacobian [1], which are those of the spatial one [2] at the point.

    [1] Siciliano, B., Sciavicco, L., Villani, L. and Oriolo, G., Robotics: Modelling, Planning and Control, Springer, 2009.
    [2] Murray, R. M., Li, Z. and Sastry, S. S., A Mathematical Introduction to Robotic Manipulation, section 3.4, CRC Press,
        1994.
    """
    components, batch = _component_first(coordinates)
    size = components.shape[1]
    position, rotation, jacobian = (np.empty((*shape, size)) for shape in ((3,), (3, 3), (6, chain.coordinates)))
    for part in blocks(size):
        frames = walk(chain, components[:, part], point.after)
        placed = place_point(frames, point)
        store_pose(placed, position[:, part], rotation[:, :, part])
        _store_twists(chain, frames, point, placed[1], jacobian[:, :, part])
    return _batch_first(position, batch), _batch_first(rotation, batch), _batch_first(jacobian, batch)


def jacobians(chain: Chain, coordinates: np.ndarray, point: MeasuringPoint) -> np.ndarray:
    """Geometric Jacobian of a measuring point, where its pose is not needed.

    `chain`, `coordinates`, `point`: as in `poses_and_jacobians`. Returns (..., 6, n): the last of what `poses_and_jacobians`
    returns.
    """
    components, batch = _component_first(coordinates)
    jacobian = np.empty((6, chain.coordinates, components.shape[1]))
    for part in blocks(components.shape[1]):
        frames = walk(chain, components[:, part], point.after)
        _store_twists(chain, frames, point, place_point(frames, point)[1], jacobian[:, :, part])
    return _batch_first(jacobian, batch)


def _component_first(coordinates: np.ndarray) -> tuple[np.ndarray, tuple[int, ...]]:
    coordinates = np.asarray(coordinates, float)
    batch = coordinates.shape[:-1]
    return np.moveaxis(coordinates, -1, 0).reshape(coordinates.shape[-1], -1), batch


def _batch_first(components: np.ndarray, batch: tuple[int, ...], before: int = 0) -> np.ndarray:
    """Memory that is component first as it is handed out; `before`: axes that stay in front, such as one of points."""
    shape = components.shape[:-1]
    components = components.reshape(*shape, *batch)
    return np.moveaxis(components, range(before, len(shape)), range(before - len(shape), 0))


def store_pose(frame: Frame, position: np.ndarray, rotation: np.ndarray) -> None:
    """Write a frame to arrays: `position` (3, S), and `rotation` (3, 3, S), whose columns are the axes."""
    axes, position[:] = frame
    for column, axis in enumerate(axes):
        rotation[:, column] = axis


def _store_twists(
    chain: Chain, frames: Sequence[Frame], point: MeasuringPoint, target: np.ndarray, jacobian: np.ndarray
) -> None:
    """Columns of the Jacobian of a point, which is at `target`; those of a coordinate that moves several transforms add up."""
    filled: set[int] = set()
    transforms = chain.transforms[: point.after]
    for number, (transform, frame) in enumerate(zip(transforms, frames, strict=False)):
        if transform.coordinate is not None:
            column = jacobian[:, transform.coordinate]
            again = transform.coordinate in filled
            twist = np.empty_like(column) if again else column
            _store_twist(transform, frame, None if _passes(transforms[number:], point) else target, twist)
            if again:
                column += twist
            filled.add(transform.coordinate)
    for coordinate in set(range(jacobian.shape[1])) - filled:
        jacobian[:, coordinate] = 0.0


def _passes(transforms: Sequence[Transform], point: MeasuringPoint) -> bool:
    """Whether a point lies on the axis of the first transform: all that lies between goes along or about this axis."""
    axis = transforms[0].axis
    aside = [length for direction, length in enumerate(point.offset_m) if direction != axis]
    return not any(aside) and all(transform.axis == axis for transform in transforms)


def _store_twist(transform: Transform, frame: Frame, target: np.ndarray | None, twist: np.ndarray) -> None:
    """Twist (6, S) at a target, which is None where a turn leaves it in its place."""
    (linear, angular), axis = (twist[:3], twist[3:]), frame[0][transform.axis]
    if transform.kind == "T":
        linear[:], angular[:] = axis, 0.0
    elif target is None:
        linear[:], angular[:] = 0.0, axis
    else:
        angular[:] = axis
        cross(axis, target - frame[1], linear)
    if transform.sign < 0:
        twist *= -1.0


def cross(first: np.ndarray, second: np.ndarray, out: np.ndarray) -> None:
    """Vector products, component first: (3, ...)."""
    product = np.empty_like(out[0])
    for i in range(3):
        np.multiply(first[i - 2], second[i - 1], out=out[i])
        np.multiply(first[i - 1], second[i - 2], out=product)
        out[i] -= product
