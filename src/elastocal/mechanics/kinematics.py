"""Equations 1-4: poses of measuring points by elementary transforms, and geometric
Jacobians by screws, for batches of configurations.

Arrays have the batch in front, ``(..., 6, n)``, but lie in memory component first, so
that every arithmetic step runs along the batch; slices such as ``jacobian[..., 0, 2]``
are contiguous. The arrays of a `Motion`, which holds poses and twists of one walk along
the chain, are component first, with the configurations behind.
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

# Block size: all intermediate arrays of this many configurations fit in a second-level
# cache.
BLOCK = 8192
# The twists of this many pairs of coordinate and configuration fit in the same cache.
_TWISTS = 16_384


def _walk(chain: Chain, coordinates: np.ndarray, until: int) -> list[Frame]:
    """Compute the frames before each of the first transforms, and behind the last of
    them, by the forward recursion of the product of transforms.

    Consecutive rotations about one axis are one rotation by the sum of their angles.

    Parameters
    ----------
    chain : Chain
    coordinates : (C, S) array, rad and m
    until : number of transforms to follow
    """
    axes = list(np.eye(3)[:, :, None])
    origin = np.zeros((3, 1))
    # The current axes are `unrotated`, turned by `angle` about `rotation_axis`.
    unrotated = axes
    rotation_axis = None
    angle: float | np.ndarray = 0.0
    frames = [(axes, origin)]
    coordinates = np.ascontiguousarray(coordinates)
    # Skip springs at rest in all configurations, so that they cost nothing.
    at_rest = np.logical_not(coordinates.any(axis=1))
    for transform in chain.transforms[:until]:
        coordinate = transform.coordinate
        if coordinate is None or not at_rest[coordinate]:
            amount = transform.constant
            if coordinate is not None:
                amount = coordinates[coordinate]
            if transform.sign < 0:
                amount = -amount
            if transform.kind == "T":
                origin = origin + amount * axes[transform.axis]
            else:
                if transform.axis == rotation_axis:
                    angle = angle + amount
                else:
                    unrotated = axes
                    angle = amount
                rotation_axis = transform.axis
                axes = _rotate(unrotated, rotation_axis, angle)
        frames.append((axes, origin))
    return frames


def _rotate(
    axes: list[np.ndarray], axis: int, angle: float | np.ndarray
) -> list[np.ndarray]:
    """Rotate the axes of a frame about one of them."""
    cosine, sine = _cosine_and_sine(angle)
    second = axes[axis - 2]
    third = axes[axis - 1]
    rotated = list(axes)
    rotated[axis - 2] = cosine * second + sine * third
    rotated[axis - 1] = cosine * third - sine * second
    return rotated


def _cosine_and_sine(
    angle: float | np.ndarray,
) -> tuple[float | np.ndarray, float | np.ndarray]:
    """Compute both, of an array from the tangent of half the angle (Weierstrass
    substitution), which is faster in numpy than either of them."""
    if isinstance(angle, float):
        return math.cos(angle), math.sin(angle)
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
    """Compute the position and orientation of a measuring point in the base frame
    (equations 1-4).

    Parameters
    ----------
    chain : Chain
    coordinates : (..., n) array
        Joint angles in rad, and springs of an extended chain in m or rad.
    point : measuring point of the chain

    Returns
    -------
    position : (..., 3) array, m, base frame
    rotation : (..., 3, 3) array
        Its columns are the axes of the point's frame in base axes.
    """
    position, rotation = compute_point_poses(chain, coordinates, [point])
    return position[0], rotation[0]


def compute_point_poses(
    chain: Chain, coordinates: np.ndarray, points: Sequence[MeasuringPoint]
) -> tuple[np.ndarray, np.ndarray]:
    """Compute poses of T measuring points in one walk along the chain.

    Parameters
    ----------
    chain, coordinates : as in `compute_poses`
    points : T measuring points of the chain

    Returns
    -------
    position : (T, ..., 3) array
    rotation : (T, ..., 3, 3) array
    """
    position, rotation = _allocate(coordinates, (len(points), 3), (len(points), 3, 3))
    last = max(point.after for point in points)
    for block, frames in _iterate_blocks(chain, coordinates, last, BLOCK):
        _store_poses(frames, points, position[..., block], rotation[..., block])
    return (
        _move_batch_first(position, coordinates, 1),
        _move_batch_first(rotation, coordinates, 1),
    )


def locate_corners(chain: Chain, coordinates: np.ndarray) -> np.ndarray:
    """Locate the corners of an arm, its base and the end of each translation, (K, ...,
    3) array, m, base axes."""
    ends = [
        index
        for index, transform in enumerate(chain.transforms, 1)
        if transform.kind == "T"
    ]
    points = [MeasuringPoint(str(after), after) for after in (0, *ends)]
    return compute_point_poses(chain, coordinates, points)[0]


def locate_joint_axes(chain: Chain, coordinates: np.ndarray) -> np.ndarray:
    """Locate the joint axes, (J, 2, ..., 3) array: a point on each axis in m, and its
    direction, base axes."""
    joints = [
        (index, transform.axis)
        for index, transform in enumerate(chain.transforms)
        if transform.coordinate is not None
    ]
    points = [MeasuringPoint(str(index), index) for index, _ in joints]
    position, rotation = compute_point_poses(chain, coordinates, points)
    directions = [
        axes[..., axis] for (_, axis), axes in zip(joints, rotation, strict=True)
    ]
    return np.stack([position, np.stack(directions)], axis=1)


def compute_poses_and_jacobians(
    chain: Chain, coordinates: np.ndarray, point: MeasuringPoint
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Compute the pose of a measuring point and its geometric Jacobian with respect to
    every coordinate of the chain.

    The twist of a revolute coordinate with axis z through o is (z x (p - o), z), of a
    prismatic one (z, 0). These are the columns of the geometric Jacobian [1], and equal
    those of the spatial Jacobian [2] at the point.

    Parameters
    ----------
    chain, coordinates, point : as in `compute_poses`

    Returns
    -------
    position : (..., 3) array, m, base frame
    rotation : (..., 3, 3) array
    jacobian : (..., 6, n) array
        Rows are the linear velocity of the point (m per unit of coordinate) and the
        angular velocity (rad per unit), base axes. Columns of coordinates behind the
        point are zero.

    References
    ----------
    [1] Siciliano, B., Sciavicco, L., Villani, L. and Oriolo, G., Robotics: Modelling,
        Planning and Control, Springer, 2009.
    [2] Murray, R. M., Li, Z. and Sastry, S. S., A Mathematical Introduction to Robotic
        Manipulation, CRC Press, 1994.
    """
    position, rotation, jacobian = _allocate(
        coordinates, (1, 3), (1, 3, 3), (6, chain.coordinates)
    )
    for block, frames in _iterate_blocks(chain, coordinates, point.after, BLOCK):
        _store_poses(frames, [point], position[..., block], rotation[..., block])
        for index, transform in enumerate(chain.transforms[: point.after]):
            if transform.coordinate is not None:
                lever = None
                if not _is_on_axis(point, chain.transforms[index : point.after]):
                    lever = frames[index][1] - position[0, :, block]
                twist = jacobian[:, transform.coordinate, block]
                _store_twist(transform, frames[index], lever, twist)
    return (
        _move_batch_first(position[0], coordinates),
        _move_batch_first(rotation[0], coordinates),
        _move_batch_first(jacobian, coordinates),
    )


def compute_jacobians(
    chain: Chain, coordinates: np.ndarray, point: MeasuringPoint
) -> np.ndarray:
    """Compute the geometric Jacobian (..., 6, n) of a measuring point alone, see
    `compute_poses_and_jacobians`."""
    return compute_poses_and_jacobians(chain, coordinates, point)[2]


def compute_position_jacobians(
    chain: Chain,
    coordinates: np.ndarray,
    points: Sequence[MeasuringPoint],
    which: np.ndarray,
) -> np.ndarray:
    """Compute the position Jacobian of one of several measuring points in each
    configuration.

    Parameters
    ----------
    chain : Chain
    coordinates : (M, n) array
    points : measuring points
    which : (M,) int array, index of the point of each configuration

    Returns
    -------
    (M, 3, n) array
    """
    jacobian = np.empty((len(which), 3, chain.coordinates))
    for number, point in enumerate(points):
        members = which == number
        jacobian[members] = compute_jacobians(chain, coordinates[members], point)[:, :3]
    return jacobian


@dataclass(frozen=True)
class Motion:
    """Poses of T points of a chain in S configurations, and the spatial twist of each
    coordinate; all arrays are component first.

    Attributes
    ----------
    position : (T, 3, S) array, m, base frame
    rotation : (T, 3, 3, S) array
    twist : (6, C, S) array
        Velocity, per unit of each coordinate, of the bodies behind it: of the body's
        point at the base's origin, then the angular one (the spatial twist, Murray, Li
        and Sastry 1994, section 3.4).
    transform_index : (C,) int array, index of the transform that a coordinate moves
    """

    position: np.ndarray
    rotation: np.ndarray
    twist: np.ndarray
    transform_index: np.ndarray

    def jacobian(
        self,
        after: int,
        position: np.ndarray,
        rows: int = 6,
        chosen: slice | np.ndarray = slice(None),
    ) -> np.ndarray:
        """Compute the geometric Jacobian of points on one body.

        Parameters
        ----------
        after : number of transforms of the chain before the body
        position : (3, S') array, m, of the points
        rows : 3 for linear velocities alone, 6 for angular ones as well
        chosen : (S',) int array, configuration of each point

        Returns
        -------
        (rows, C, S') array
        """
        twist = self.twist[..., chosen]
        angular = twist[3:]
        jacobian = np.empty_like(twist[:rows])
        multiply_vectors(angular, position, jacobian[:3])
        jacobian[:3] += twist[:3]
        jacobian[3:] = angular[: rows - 3]
        jacobian[:, self.transform_index >= after] = 0.0
        return jacobian

    def generalized_forces(
        self, after: int, wrench: np.ndarray, coordinates: slice = slice(None)
    ) -> np.ndarray:
        """Compute the forces and torques on coordinates by a wrench on one body.

        Parameters
        ----------
        after : number of transforms of the chain before the body
        wrench : (6, S) array, force, and moment about the base's origin
        coordinates : coordinates of the result

        Returns
        -------
        (coordinates, S) array
        """
        forces = np.einsum("iks,is->ks", self.twist[:, coordinates], wrench)
        forces[self.transform_index[coordinates] >= after] = 0.0
        return forces


def compute_motion(
    chain: Chain, coordinates: np.ndarray, points: Sequence[MeasuringPoint]
) -> Motion:
    """Compute the poses of measuring points and the twist of every coordinate in one
    walk along the chain.

    Parameters
    ----------
    chain : Chain
    coordinates : (S, C) array, rad and m
    points : T measuring points
    """
    moving = sorted(
        (transform.coordinate, index)
        for index, transform in enumerate(chain.transforms)
        if transform.coordinate is not None
    )
    indices = [index for _, index in moving]
    count = len(coordinates)
    position = np.empty((len(points), 3, count))
    rotation = np.empty((len(points), 3, 3, count))
    twist = np.empty((6, len(indices), count))
    # Frames of all transforms take more memory than frames up to a point.
    for block, frames in _iterate_blocks(
        chain, coordinates, len(chain.transforms), BLOCK // 2
    ):
        _store_poses(frames, points, position[..., block], rotation[..., block])
        # With fewer configurations, process more coordinates in one step.
        step = max(_TWISTS // max(len(coordinates[block]), 1), 1)
        for start in range(0, len(indices), step):
            _store_spatial_twists(
                chain,
                frames,
                indices[start : start + step],
                twist[:, start : start + step, block],
            )
    return Motion(position, rotation, twist, np.array(indices, int))


def compute_pose_differences(
    position: np.ndarray,
    rotation: np.ndarray,
    position_0: np.ndarray,
    rotation_0: np.ndarray,
) -> np.ndarray:
    """Compute the displacement (m) and rotation vector (rad) from one pose to another.

    Parameters
    ----------
    position, rotation : (..., 3) and (..., 3, 3) arrays, pose at the end
    position_0, rotation_0 : pose at the start

    Returns
    -------
    (..., 6) array
        In base axes; memory is component first.
    """
    relative = np.empty((3, 3, *position.shape[:-1]))
    for i in range(3):
        for j in range(3):
            relative[i, j] = sum(
                rotation[..., i, k] * rotation_0[..., j, k] for k in range(3)
            )
    vector = compute_rotation_vectors(np.moveaxis(relative, (0, 1), (-2, -1)))
    difference = np.empty((6, *position.shape[:-1]))
    difference[:3] = np.moveaxis(position - position_0, -1, 0)
    difference[3:] = np.moveaxis(vector, -1, 0)
    return np.moveaxis(difference, 0, -1)


def compute_rotation_vectors(rotation: np.ndarray) -> np.ndarray:
    """Compute rotation vectors (..., 3), rad, of rotation matrices (..., 3, 3), for
    angles below pi.

    The logarithm on SO(3) by the arctangent of sine and cosine, so that small angles
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


def _iterate_blocks(
    chain: Chain, coordinates: np.ndarray, until: int, block_size: int
) -> Iterator[tuple[slice, list[Frame]]]:
    """Compute the frames of `_walk` for one block of the configurations (..., C) after
    the other."""
    components = np.moveaxis(np.asarray(coordinates, float), -1, 0)
    components = components.reshape(len(components), -1)
    for start in range(0, components.shape[1], block_size):
        block = slice(start, start + block_size)
        yield block, _walk(chain, components[:, block], until)


def _allocate(coordinates: np.ndarray, *shapes: tuple[int, ...]) -> list[np.ndarray]:
    """Allocate arrays of such shapes for each of the configurations (..., C), component
    first.

    They are zero, which is the Jacobian of a coordinate that moves nothing.
    """
    count = math.prod(np.shape(coordinates)[:-1])
    return [np.zeros((*shape, count)) for shape in shapes]


def _move_batch_first(
    components: np.ndarray, coordinates: np.ndarray, leading: int = 0
) -> np.ndarray:
    """Move the batch of a component-first array to the front, behind `leading` axes
    that stay there, such as one of points."""
    shape = components.shape[:-1]
    components = components.reshape(*shape, *np.shape(coordinates)[:-1])
    return np.moveaxis(
        components, range(leading, len(shape)), range(leading - len(shape), 0)
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


def _is_on_axis(point: MeasuringPoint, transforms: Sequence[Transform]) -> bool:
    """Whether a point lies on the axis of the first of the transforms before it: they
    and the offset of the point are all along or about this axis."""
    axis = transforms[0].axis
    lateral = [
        length for direction, length in enumerate(point.offset_m) if direction != axis
    ]
    return not any(lateral) and all(transform.axis == axis for transform in transforms)


def _store_twist(
    transform: Transform, frame: Frame, lever: np.ndarray | None, twist: np.ndarray
) -> None:
    """Write the twist (6, S) of a point by a transform.

    `lever` (3, S) leads from the point to the axis; None if the point is on the axis.
    """
    axis = frame[0][transform.axis]
    linear = twist[:3]
    twist[3:] = axis
    if transform.kind == "T":
        linear[:] = axis
        twist[3:] = 0.0
    elif lever is None:
        linear[:] = 0.0
    else:
        multiply_vectors(lever, axis, linear)
    if transform.sign < 0:
        twist *= -1.0


def _store_spatial_twists(
    chain: Chain, frames: Sequence[Frame], indices: Sequence[int], twist: np.ndarray
) -> None:
    """Write the spatial twists (6, K, S) of the transforms with some indices."""
    linear = twist[:3]
    angular = twist[3:]
    origins = np.empty(angular.shape)
    translations = []
    for column, index in enumerate(indices):
        transform = chain.transforms[index]
        axes, origin = frames[index]
        origins[:, column] = origin
        axis = axes[transform.axis]
        if transform.sign < 0:
            axis = -axis
        if transform.kind == "T":
            angular[:, column] = 0.0
            translations.append((column, axis))
        else:
            angular[:, column] = axis
    multiply_vectors(origins, angular, linear)
    for column, axis in translations:
        linear[:, column] = axis


def multiply_vectors(first: np.ndarray, second: np.ndarray, out: np.ndarray) -> None:
    """Write the vector products of component-first arrays (3, ...) to `out`."""
    product = np.empty_like(out[0])
    for i in range(3):
        np.multiply(first[i - 2], second[i - 1], out=out[i])
        np.multiply(first[i - 1], second[i - 2], out=product)
        out[i] -= product


def form_cross_matrices(vectors: np.ndarray) -> np.ndarray:
    """Form the matrices (M, 3, 3) that multiply other vectors as the cross product with
    vectors (M, 3) from the left does."""
    return np.cross(vectors[:, None], np.eye(3)).transpose(0, 2, 1)


def align_points(
    points: np.ndarray, measured: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Compute the rotation (3, 3) and translation (3,), m, that move points (N, 3) onto
    measured ones best in the sense of least squares, by the Kabsch algorithm [1]_ [2]_.

    References
    ----------
    .. [1] Kabsch, A solution for the best rotation to relate two sets of vectors, Acta
       Crystallographica A32, 1976.
    .. [2] Umeyama, Least-squares estimation of transformation parameters between two
       point patterns, IEEE Transactions on Pattern Analysis and Machine Intelligence 13,
       1991.
    """
    centre = points.mean(axis=0)
    measured_centre = measured.mean(axis=0)
    covariance = (measured - measured_centre).T @ (points - centre)
    left_vectors, _, right_vectors = np.linalg.svd(covariance)
    left_vectors[:, -1] *= np.sign(np.linalg.det(left_vectors @ right_vectors))
    rotation = left_vectors @ right_vectors
    return rotation, measured_centre - rotation @ centre
