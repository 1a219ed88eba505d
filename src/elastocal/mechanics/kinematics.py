"""Equations 1-4: poses of any measuring point by elementary transforms, its geometric Jacobian by screws; batched.

Arrays come and go with the batch in front, ``(..., 6, n)``, but lie in memory component first, so that every arithmetic step
runs along the batch; slices such as ``jacobian[..., 0, 2]`` are contiguous.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from elastocal.mechanics.chain import MeasuringPoint
from elastocal.mechanics.chain_walk import blocks, store_pose, sweep
from elastocal.mechanics.products import product, product_difference

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from elastocal.mechanics.chain import Chain
    from elastocal.mechanics.chain_walk import Screw, Vector


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
        frames, _ = sweep(chain, components[:, part], points)
        for number, frame in enumerate(frames):
            store_pose(*frame, position[number, :, part], rotation[number, :, :, part])
    return _each_batch_first(position, batch), _each_batch_first(rotation, batch)


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
    chain: Chain, coordinates: np.ndarray, point: MeasuringPoint, out: tuple[np.ndarray, np.ndarray, np.ndarray] | None = None
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Pose of a measuring point and its geometric Jacobian with respect to every coordinate of the chain.

    `coordinates` (..., n): joint angles in rad (and springs of an extended chain in m or rad). `out`: what an earlier call for
    as many configurations returned; the results overwrite it and no memory is allocated. Returns `position` (..., 3): m, base
    frame; `rotation` (..., 3, 3); `jacobian` (..., 6, n): rows: linear velocity of the point (m per unit of coordinate),
    angular velocity (rad per unit), base axes. Columns of coordinates behind the point are zero.

    The twist of a revolute coordinate with axis z through o is (z x (p - o), z), of a prismatic one (z, 0): the columns of the
    geometric Jacobian [1], which are those of the spatial one [2] at the point.

    [1] Siciliano, B., Sciavicco, L., Villani, L. and Oriolo, G., Robotics: Modelling, Planning and Control, Springer, 2009.
    [2] Murray, R. M., Li, Z. and Sastry, S. S., A Mathematical Introduction to Robotic Manipulation, section 3.4, CRC Press,
        1994.
    """
    components, batch = _component_first(coordinates)
    size = components.shape[1]
    shapes = ((3,), (3, 3), (6, chain.coordinates))
    if out is None:
        results = [np.empty((*shape, size)) for shape in shapes]
    else:
        results = [_component_first_view(array, len(shape)) for array, shape in zip(out, shapes, strict=True)]
    position, rotation, jacobian = results
    for part in blocks(size):
        ((axes, origin),), screws = sweep(chain, components[:, part], [point])
        store_pose(axes, origin, position[:, part], rotation[:, :, part])
        _store_twists(screws, point.after, origin, jacobian[:, :, part])
    return _batch_first(position, batch), _batch_first(rotation, batch), _batch_first(jacobian, batch)


def jacobians(chain: Chain, coordinates: np.ndarray, point: MeasuringPoint) -> np.ndarray:
    """Geometric Jacobian of a measuring point, where its pose is not needed.

    `chain`, `coordinates`, `point`: as in `poses_and_jacobians`. Returns (..., 6, n): the last of what `poses_and_jacobians`
    returns.
    """
    components, batch = _component_first(coordinates)
    jacobian = np.empty((6, chain.coordinates, components.shape[1]))
    for part in blocks(components.shape[1]):
        ((_, origin),), screws = sweep(chain, components[:, part], [point])
        _store_twists(screws, point.after, origin, jacobian[:, :, part])
    return _batch_first(jacobian, batch)


def _component_first(coordinates: np.ndarray) -> tuple[np.ndarray, tuple[int, ...]]:
    coordinates = np.asarray(coordinates, float)
    batch = coordinates.shape[:-1]
    return np.moveaxis(coordinates, -1, 0).reshape(coordinates.shape[-1], -1), batch


def _component_first_view(array: np.ndarray, axes: int) -> np.ndarray:
    """Memory of a result of this module, component first."""
    components = np.moveaxis(array, range(-axes, 0), range(axes))
    return components.reshape(*components.shape[:axes], -1)


def _batch_first(components: np.ndarray, batch: tuple[int, ...]) -> np.ndarray:
    shape = components.shape[:-1]
    components = components.reshape(*shape, *batch)
    return np.moveaxis(components, range(len(shape)), range(-len(shape), 0))


def _each_batch_first(components: np.ndarray, batch: tuple[int, ...]) -> np.ndarray:
    """As `_batch_first`, behind an axis of points."""
    shape = components.shape[1:-1]
    components = components.reshape(len(components), *shape, *batch)
    return np.moveaxis(components, range(1, 1 + len(shape)), range(-len(shape), 0))


def _store_twists(screws: Iterable[Screw], after: int, target: Vector, jacobian: np.ndarray) -> None:
    """Columns of a Jacobian; a coordinate that moves several transforms has the sum of their twists."""
    levers: dict[int, Vector] = {}
    filled: set[int] = set()
    for screw in screws:
        if screw.place >= after:
            break
        if screw.coordinate in filled:
            twist = np.zeros((6, jacobian.shape[2]))
            _store_twist(screw, target, levers, twist)
            jacobian[:, screw.coordinate] += twist
        else:
            _store_twist(screw, target, levers, jacobian[:, screw.coordinate])
        filled.add(screw.coordinate)
    for coordinate in set(range(jacobian.shape[1])) - filled:
        jacobian[:, coordinate] = 0.0


def _store_twist(screw: Screw, target: Vector, levers: dict[int, Vector], twist: np.ndarray) -> None:
    axis, origin = screw.axis, screw.origin
    linear, angular = twist[:3], twist[3:]
    if screw.kind == "T":
        _store(axis, linear)
        angular[:] = 0.0
    elif origin is None:
        linear[:] = 0.0
        _store(axis, angular)
    else:
        # Joints that meet in one point, as in a spherical wrist, share their lever.
        if id(origin) not in levers:
            levers[id(origin)] = [product_difference(1.0, p, 1.0, o) for p, o in zip(target, origin, strict=True)]
        _store_cross(axis, levers[id(origin)], linear)
        _store(axis, angular)
    if screw.sign < 0:
        twist *= -1.0


def _store(vector: Vector, out: np.ndarray) -> None:
    for component, place in zip(vector, out, strict=True):
        place[:] = component


def _store_cross(a: Vector, b: Vector, out: np.ndarray) -> None:
    for i, place in enumerate(out):
        np.subtract(product(a[i - 2], b[i - 1]), product(a[i - 1], b[i - 2]), out=place)
