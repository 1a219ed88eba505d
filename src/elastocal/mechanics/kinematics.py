"""Equations 1-4: poses of any measuring point by elementary transforms, its geometric
Jacobian by screws; batched.

Arrays come and go with the batch in front, ``(..., 6, n)``, but lie in memory component
first, so that every arithmetic step runs along the batch; slices such as
``jacobian[..., 0, 2]`` are contiguous. Those of a `Motion`, poses of points and twists
from one walk along the chain, are component first, with the configurations behind.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from elastocal.mechanics.chain import MeasuringPoint

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from elastocal.mechanics.chain import Chain, Transform

    # The three axes of a frame and its origin in base axes: each (3, S), or (3, 1)
    # before any coordinate has moved it.
    Frame = tuple[list[np.ndarray], np.ndarray]

# So many configurations at a time keep all intermediate arrays in a second-level cache;
# so many of their twists, too.
BLOCK = 8192
_TWISTS = 16_384


def _walk(chain: Chain, coordinates: np.ndarray, until: int) -> list[Frame]:
    """Frames along a chain: before each of so many transforms, and behind the last of
    them.

    `coordinates` (C, S): rad and m. The forward recursion of the product of transforms;
    turns that follow one another about one axis are one turn by the sum of their
    angles.
    """
    axes = list(np.eye(3)[:, :, None])
    origin = np.zeros((3, 1))
    before = axes
    about = None
    angle = 0.0
    frames = [(axes, origin)]
    coordinates = np.ascontiguousarray(coordinates)
    # Springs that no configuration moves cost nothing.
    rest = np.logical_not(coordinates.any(axis=1))
    for transform in chain.transforms[:until]:
        axis = transform.axis
        driven = transform.coordinate
        if driven is None or not rest[driven]:
            amount = transform.constant if driven is None else coordinates[driven]
            if transform.sign < 0:
                amount = -amount
            if transform.kind == "T":
                origin = origin + amount * axes[axis]
            else:
                before, angle = (
                    (before, angle + amount) if axis == about else (axes, amount)
                )
                axes = _turn(before, axis, angle)
                about = axis
        frames.append((axes, origin))
    return frames


def _turn(
    axes: list[np.ndarray], about: int, angle: float | np.ndarray
) -> list[np.ndarray]:
    """Axes of a frame after it has turned about one of them."""
    cosine, sine = (
        (math.cos(angle), math.sin(angle))
        if isinstance(angle, float)
        else _cosine_and_sine(angle)
    )
    second = axes[about - 2]
    third = axes[about - 1]
    turned = list(axes)
    turned[about - 2] = cosine * second + sine * third
    turned[about - 1] = cosine * third - sine * second
    return turned


def _cosine_and_sine(angle: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """By the tangent of half the angle (Weierstrass substitution), which is faster in
    numpy than either of them."""
    tangent = np.tan(0.5 * angle)
    scale = tangent * tangent
    scale += 1.0
    np.divide(2.0, scale, out=scale)
    tangent *= scale
    scale -= 1.0
    return scale, tangent


def compute_poses(
    chain: Chain, coordinates: np.ndarray, point: MeasuringPoint
) -> tuple[np.ndarray, np.ndarray]:
    """Position and orientation of a measuring point in the base frame (equations 1-4).

    `coordinates` (..., n): joint angles in rad (and springs of an extended chain in m
    or rad). Returns `position` (..., 3): m, base frame; `rotation` (..., 3, 3): columns
    are the axes of the point's frame in base axes.
    """
    position, rotation = compute_point_poses(chain, coordinates, [point])
    return position[0], rotation[0]


def compute_point_poses(
    chain: Chain, coordinates: np.ndarray, points: Sequence[MeasuringPoint]
) -> tuple[np.ndarray, np.ndarray]:
    """Poses of several measuring points in one walk along the chain: `position` (T,
    ..., 3), `rotation` (T, ..., 3, 3)."""
    position, rotation = _room(coordinates, (len(points), 3), (len(points), 3, 3))
    for part, frames in _blocks(
        chain, coordinates, max(point.after for point in points)
    ):
        _store_poses(frames, points, position[..., part], rotation[..., part])
    return _batch_first(position, coordinates, 1), _batch_first(
        rotation, coordinates, 1
    )


def locate_corners(chain: Chain, coordinates: np.ndarray) -> np.ndarray:
    """Where an arm has corners: at its base and behind each translation, ndarray (K,
    ..., 3), m, base axes."""
    places = [
        0,
        *(
            number + 1
            for number, transform in enumerate(chain.transforms)
            if transform.kind == "T"
        ),
    ]
    return compute_point_poses(
        chain, coordinates, [MeasuringPoint(str(place), place) for place in places]
    )[0]


def locate_joint_axes(chain: Chain, coordinates: np.ndarray) -> np.ndarray:
    """A place on the axis of each joint, m, and its direction, base axes, ndarray (J,
    2, ..., 3)."""
    moved = [
        number for number, t in enumerate(chain.transforms) if t.coordinate is not None
    ]
    position, rotation = compute_point_poses(
        chain, coordinates, [MeasuringPoint(str(number), number) for number in moved]
    )
    axes = np.stack(
        [
            turned[..., chain.transforms[number].axis]
            for number, turned in zip(moved, rotation, strict=True)
        ]
    )
    return np.stack([position, axes], axis=1)


def compute_poses_and_jacobians(
    chain: Chain, coordinates: np.ndarray, point: MeasuringPoint
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Pose of a measuring point and its geometric Jacobian with respect to every
    coordinate of the chain.

    `coordinates` (..., n): joint angles in rad (and springs of an extended chain in m
    or rad). Returns `position` (..., 3): m, base frame; `rotation` (..., 3, 3);
    `jacobian` (..., 6, n): rows: linear velocity of the point (m per unit of
    coordinate), angular velocity (rad per unit), base axes. Columns of coordinates
    behind the point are zero.

    The twist of a revolute coordinate with axis z through o is (z x (p - o), z), of a
    prismatic one (z, 0): the columns of the geometric Jacobian [1], which are those of
    the spatial one [2] at the point.

    [1] Siciliano, B., Sciavicco, L., Villani, L. and Oriolo, G., Robotics: Modelling,
    Planning and Control, Springer, 2009. [2] Murray, R. M., Li, Z. and Sastry, S. S., A
    Mathematical Introduction to Robotic Manipulation, CRC Press, 1994.
    """
    position, rotation, jacobian = _room(
        coordinates, (1, 3), (1, 3, 3), (6, chain.coordinates)
    )
    for part, frames in _blocks(chain, coordinates, point.after):
        _store_poses(frames, [point], position[..., part], rotation[..., part])
        for number, transform in enumerate(chain.transforms[: point.after]):
            if transform.coordinate is not None:
                passes = _passes(chain.transforms[number : point.after], point)
                arm = None if passes else frames[number][1] - position[0, :, part]
                _store_twist(
                    transform,
                    frames[number],
                    arm,
                    jacobian[:, transform.coordinate, part],
                )
    pose = (
        _batch_first(position[0], coordinates),
        _batch_first(rotation[0], coordinates),
    )
    return *pose, _batch_first(jacobian, coordinates)


def compute_jacobians(
    chain: Chain, coordinates: np.ndarray, point: MeasuringPoint
) -> np.ndarray:
    """Geometric Jacobian of a measuring point, (..., 6, n), as by
    `poses_and_jacobians`, where its pose is not needed."""
    return compute_poses_and_jacobians(chain, coordinates, point)[2]


def compute_position_jacobians(
    chain: Chain,
    coordinates: np.ndarray,
    points: Sequence[MeasuringPoint],
    which: np.ndarray,
) -> np.ndarray:
    """How the measuring point `which` (M,) of some moves with the coordinates (M, n) of
    the chain, ndarray (M, 3, n)."""
    found = np.empty((len(which), 3, chain.coordinates))
    for number, point in enumerate(points):
        found[which == number] = compute_jacobians(
            chain, coordinates[which == number], point
        )[:, :3]
    return found


@dataclass(frozen=True)
class Motion:
    """Poses of some points of a chain, and how each transform that moves would move
    everything behind it; component first.

    `position` (T, 3, S): m, base frame. `rotation` (T, 3, 3, S). `twist` (6, C, S): for
    each coordinate the velocity of what lies behind it, per unit: of the body's point
    at the base's origin, then the angular one (the spatial twist, Murray, Li and Sastry
    1994, section 3.4). `place` (C,) of int: how many transforms come before the one
    that it moves.
    """

    position: np.ndarray
    rotation: np.ndarray
    twist: np.ndarray
    place: np.ndarray

    def jacobian(
        self,
        after: int,
        position: np.ndarray,
        rows: int = 6,
        chosen: slice | np.ndarray = slice(None),
    ) -> np.ndarray:
        """Geometric Jacobian of points behind so many transforms of the chain, (rows,
        C, S').

        `position` (3, S'): where the points are, m. `rows`: linear velocities alone, or
        also angular ones. `chosen` (S',) of int: configuration of each.
        """
        twist = self.twist[..., chosen]
        angular = twist[3:]
        moved = np.empty_like(twist[:rows])
        multiply_vectors(angular, position, moved[:3])
        moved[:3] += twist[:3]
        moved[3:] = angular[: rows - 3]
        moved[:, self.place >= after] = 0.0
        return moved

    def generalized_forces(
        self, after: int, wrench: np.ndarray, coordinates: slice = slice(None)
    ) -> np.ndarray:
        """Force or torque on each of the coordinates (., S) by a wrench on what lies
        behind so many transforms of the chain.

        `wrench` (6, S): force, and moment about the base's origin.
        """
        on_each = np.einsum("iks,is->ks", self.twist[:, coordinates], wrench)
        on_each[self.place[coordinates] >= after] = 0.0
        return on_each


def compute_motion(
    chain: Chain, coordinates: np.ndarray, points: Sequence[MeasuringPoint]
) -> Motion:
    """Poses of several measuring points and the twist of every transform that moves, in
    one walk along the chain.

    `coordinates` (S, C): rad and m.
    """
    moving = sorted(
        (t.coordinate, place)
        for place, t in enumerate(chain.transforms)
        if t.coordinate is not None
    )
    shapes = (len(points), 3), (len(points), 3, 3), (6, len(moving))
    position, rotation, twist = (
        np.empty((*shape, len(coordinates))) for shape in shapes
    )
    # Frames of all transforms take more than those up to a point.
    for part, frames in _blocks(chain, coordinates, len(chain.transforms), BLOCK // 2):
        _store_poses(frames, points, position[..., part], rotation[..., part])
        # Those of many coordinates at once where there are few configurations.
        step = max(_TWISTS // max(len(coordinates[part]), 1), 1)
        for start in range(0, len(moving), step):
            linear = twist[:3, start : start + step, part]
            angular = twist[3:, start : start + step, part]
            origins = np.empty(angular.shape)
            slides = []
            for number, (_, place) in enumerate(moving[start : start + step]):
                transform, (axes, origins[:, number]) = (
                    chain.transforms[place],
                    frames[place],
                )
                axis = (
                    axes[transform.axis]
                    if transform.sign > 0
                    else -axes[transform.axis]
                )
                angular[:, number] = 0.0 if transform.kind == "T" else axis
                slides += [(number, axis)] if transform.kind == "T" else []
            multiply_vectors(origins, angular, linear)
            for number, axis in slides:
                linear[:, number] = axis
    return Motion(
        position, rotation, twist, np.array([place for _, place in moving], int)
    )


def compute_pose_differences(
    position: np.ndarray,
    rotation: np.ndarray,
    position_0: np.ndarray,
    rotation_0: np.ndarray,
) -> np.ndarray:
    """How far one pose is from another: displacement (m) and rotation vector (rad),
    both in base axes.

    `position`, `position_0` (..., 3), `rotation`, `rotation_0` (..., 3, 3). Returns
    (..., 6): memory is component first.
    """
    relative = np.empty((3, 3, *position.shape[:-1]))
    for i in range(3):
        for j in range(3):
            relative[i, j] = sum(
                rotation[..., i, k] * rotation_0[..., j, k] for k in range(3)
            )
    turn = compute_rotation_vectors(np.moveaxis(relative, (0, 1), (-2, -1)))
    difference = np.empty((6, *position.shape[:-1]))
    difference[:3] = np.moveaxis(position - position_0, -1, 0)
    difference[3:] = np.moveaxis(turn, -1, 0)
    return np.moveaxis(difference, 0, -1)


def compute_rotation_vectors(rotation: np.ndarray) -> np.ndarray:
    """Rotation vectors (..., 3), rad, of rotation matrices (..., 3, 3), for angles
    below pi.

    The logarithm on SO(3), by the arctangent of sine and cosine, so that small angles
    keep their digits.
    """
    skew = 0.5 * np.stack(
        [rotation[..., i - 1, i - 2] - rotation[..., i - 2, i - 1] for i in range(3)]
    )
    sine = np.sqrt((skew**2).sum(axis=0))
    cosine = 0.5 * (
        rotation[..., 0, 0] + rotation[..., 1, 1] + rotation[..., 2, 2] - 1.0
    )
    angle = np.arctan2(sine, cosine)
    scale = np.divide(angle, sine, out=np.ones_like(sine), where=sine > 0)
    return np.moveaxis(skew * scale, 0, -1)


def _blocks(
    chain: Chain, coordinates: np.ndarray, until: int, size: int = BLOCK
) -> Iterator[tuple[slice, list[Frame]]]:
    """Frames of `_walk` for coordinates (..., C), a block of configurations after the
    other."""
    components = np.moveaxis(np.asarray(coordinates, float), -1, 0).reshape(
        np.shape(coordinates)[-1], -1
    )
    for start in range(0, components.shape[1], size):
        part = slice(start, start + size)
        yield part, _walk(chain, components[:, part], until)


def _room(coordinates: np.ndarray, *shapes: tuple[int, ...]) -> list[np.ndarray]:
    """Arrays of such shapes for each of the configurations (..., C), component first;
    zero, as what does not move stays."""
    return [
        np.zeros((*shape, math.prod(np.shape(coordinates)[:-1]))) for shape in shapes
    ]


def _batch_first(
    components: np.ndarray, coordinates: np.ndarray, before: int = 0
) -> np.ndarray:
    """Memory that is component first as it is handed out; `before`: axes that stay in
    front, such as one of points."""
    shape = components.shape[:-1]
    components = components.reshape(*shape, *np.shape(coordinates)[:-1])
    return np.moveaxis(
        components, range(before, len(shape)), range(before - len(shape), 0)
    )


def _store_poses(
    frames: Sequence[Frame],
    points: Sequence[MeasuringPoint],
    position: np.ndarray,
    rotation: np.ndarray,
) -> None:
    """Write the frames of measuring points to arrays: (T, 3, S), and (T, 3, 3, S),
    whose columns are the axes."""
    for number, point in enumerate(points):
        axes, origin = frames[point.after]
        for axis, length in zip(axes, point.offset_m, strict=True):
            if length:
                origin = origin + length * axis
        position[number] = origin
        for column, axis in enumerate(axes):
            rotation[number, :, column] = axis


def _passes(transforms: Sequence[Transform], point: MeasuringPoint) -> bool:
    """Whether a point lies on the axis of the first transform: all that lies between
    goes along or about this axis."""
    axis = transforms[0].axis
    aside = [
        length for direction, length in enumerate(point.offset_m) if direction != axis
    ]
    return not any(aside) and all(transform.axis == axis for transform in transforms)


def _store_twist(
    transform: Transform, frame: Frame, arm: np.ndarray | None, twist: np.ndarray
) -> None:
    """Twist (6, S) of a target, which an `arm` (3, S) leads from to the axis; None
    where a turn leaves it in its place."""
    (linear, angular), axis = (twist[:3], twist[3:]), frame[0][transform.axis]
    if transform.kind == "T":
        linear[:] = axis
        angular[:] = 0.0
    elif arm is None:
        linear[:] = 0.0
        angular[:] = axis
    else:
        angular[:] = axis
        multiply_vectors(arm, axis, linear)
    if transform.sign < 0:
        twist *= -1.0


def multiply_vectors(first: np.ndarray, second: np.ndarray, out: np.ndarray) -> None:
    """Vector products, component first: (3, ...)."""
    product = np.empty_like(out[0])
    for i in range(3):
        np.multiply(first[i - 2], second[i - 1], out=out[i])
        np.multiply(first[i - 1], second[i - 2], out=product)
        out[i] -= product
