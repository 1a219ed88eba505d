"""Equations 1-4: poses and geometric Jacobians of any measuring point, by screw theory, batched over any leading axes.

Arrays come and go with the batch in front, ``(..., 6, n)``, but lie in memory component first, so that every arithmetic step
runs along the batch; slices such as ``jacobian[..., 0, 2]`` are contiguous. Entries of the frame that a chain leaves at 0 or 1
for every configuration stay plain numbers and cost nothing.
"""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

# So many configurations at a time keep all intermediate arrays in a second-level cache.
BLOCK = 8192


@dataclass(frozen=True)
class Motion:
    """Poses of some points of a chain, and how each transform that moves would move everything behind it; component first.

    Attributes
    ----------
    position : ndarray (T, 3, S)
        m, base frame.
    rotation : ndarray (T, 3, 3, S)
    twist : ndarray (6, K, S)
        For each moving transform, in the order of their coordinates, the velocity of what lies behind it, per unit of the
        coordinate: of the body's point at the base's origin, then the angular one (the spatial twist of Murray, Li and Sastry
        1994, 3.4).
    place, coordinate : ndarray of int (K,)
        How many transforms come before each, and the coordinate that moves it.
    """

    position: np.ndarray
    rotation: np.ndarray
    twist: np.ndarray
    place: np.ndarray
    coordinate: np.ndarray

    def jacobian(self, after, position, rows=6, chosen=slice(None)):
        """Geometric Jacobian of points behind so many transforms of the chain.

        Parameters
        ----------
        after : int
        position : ndarray (3, S')
            Where the points are, m.
        rows : {3, 6}
            Linear velocities alone, or also angular ones.
        chosen : slice or ndarray of int (S',), optional
            Configuration of each.

        Returns
        -------
        ndarray (rows, C, S')
        """
        twist = self.twist[..., chosen]
        angular, product = twist[3:], np.empty_like(twist[0])
        moved = np.empty_like(twist[:rows])
        for i in range(3):
            np.multiply(angular[i - 2], position[i - 1], out=moved[i])
            np.multiply(angular[i - 1], position[i - 2], out=product)
            moved[i] -= product
            moved[i] += twist[i]
        moved[3:] = angular[: rows - 3]
        return self._behind_none(moved, after)

    def generalized_forces(self, after, force, moment):
        """Force or torque on each coordinate by a wrench on what lies behind so many transforms of the chain.

        Parameters
        ----------
        after : int
        force, moment : ndarray (3, S)
            The moment about the base's origin.

        Returns
        -------
        ndarray (C, S)
        """
        on_each = np.einsum("ik...,i...->k...", self.twist, np.concatenate([force, moment]))
        return self._behind_none(on_each, after)

    def by_coordinate(self, values):
        """Values (..., K', S) of the transforms of the first coordinates, or of all, summed for each: (..., C', S)."""
        if self._one_each:
            return values
        coordinate = self.coordinate[: values.shape[-2]]
        out = np.zeros((*values.shape[:-2], coordinate[-1] + 1, values.shape[-1]))
        np.add.at(out, (..., coordinate, slice(None)), values)
        return out

    def _behind_none(self, values, after):
        """By coordinate, without transforms behind a place of the chain."""
        behind = self.place >= after
        if behind.any():
            values[..., behind, :] = 0.0
        return self.by_coordinate(values)

    @cached_property
    def _one_each(self):
        return len(np.unique(self.coordinate)) == len(self.coordinate)


def motion(chain, coordinates, points):
    """Poses of several measuring points and the twist of every transform that moves, in one walk along the chain.

    Parameters
    ----------
    chain : Chain
    coordinates : ndarray (S, C)
        rad and m.
    points : sequence of MeasuringPoint

    Returns
    -------
    Motion
    """
    components = np.ascontiguousarray(np.asarray(coordinates, float).T)
    size = components.shape[1]
    walked = chain.transforms
    position, rotation = np.empty((len(points), 3, size)), np.empty((len(points), 3, 3, size))
    moving = sorted((t.coordinate, place) for place, t in enumerate(walked) if t.coordinate is not None)
    order = {place: number for number, (_, place) in enumerate(moving)}
    axis, origin = np.empty((2, 3, len(moving), size))
    for part in _blocks(size):
        frames, screws = _sweep(chain, components[:, part], points, lines=True)
        for number, frame in enumerate(frames):
            _store_pose(*frame, position[number, :, part], rotation[number, :, :, part])
        for screw in screws:
            for i in range(3):
                axis[i, order[screw.place], part], origin[i, order[screw.place], part] = screw.axis[i], screw.origin[i]
    driven, places = np.array(moving, int).T
    signs = np.array([walked[place].sign for place in places])[:, None]
    if (signs < 0).any():
        axis *= signs
    twist = np.empty((6, len(moving), size))
    twist[3:] = axis
    for i in range(3):
        np.multiply(origin[i - 2], axis[i - 1], out=twist[i])
        twist[i] -= origin[i - 1] * axis[i - 2]
    shifts = np.array([walked[place].kind == "T" for place in places], bool)
    twist[:3, shifts], twist[3:, shifts] = axis[:, shifts], 0.0
    return Motion(position, rotation, twist, places, driven)


def poses(chain, coordinates, point):
    """Position and orientation of a measuring point in the base frame (equations 1-4).

    Parameters
    ----------
    chain : Chain
    coordinates : array_like (..., n)
        Joint angles in rad (and springs of an extended chain in m or rad).
    point : MeasuringPoint

    Returns
    -------
    position : ndarray (..., 3)
        m, base frame.
    rotation : ndarray (..., 3, 3)
        Columns are the axes of the point's frame in base axes.
    """
    position, rotation = poses_of_points(chain, coordinates, [point])
    return position[0], rotation[0]


def poses_of_points(chain, coordinates, points):
    """Poses of several measuring points in one walk along the chain.

    Parameters
    ----------
    chain, coordinates
        As in `poses`.
    points : sequence of MeasuringPoint

    Returns
    -------
    position : ndarray (T, ..., 3)
    rotation : ndarray (T, ..., 3, 3)
    """
    components, batch = _component_first(coordinates)
    size = components.shape[1]
    position, rotation = np.empty((len(points), 3, size)), np.empty((len(points), 3, 3, size))
    for part in _blocks(size):
        frames, _ = _sweep(chain, components[:, part], points)
        for number, frame in enumerate(frames):
            _store_pose(*frame, position[number, :, part], rotation[number, :, :, part])
    return _each_batch_first(position, batch), _each_batch_first(rotation, batch)


def poses_and_jacobians(chain, coordinates, point, out=None):
    """Pose of a measuring point and its geometric Jacobian with respect to every coordinate of the chain.

    Parameters
    ----------
    chain : Chain
    coordinates : array_like (..., n)
        Joint angles in rad (and springs of an extended chain in m or rad).
    point : MeasuringPoint
    out : tuple, optional
        What an earlier call for as many configurations returned; the results overwrite it and no memory is allocated.

    Returns
    -------
    position : ndarray (..., 3)
        m, base frame.
    rotation : ndarray (..., 3, 3)
    jacobian : ndarray (..., 6, n)
        Rows: linear velocity of the point (m per unit of coordinate), angular velocity (rad per unit), base axes. Columns of
        coordinates behind the point are zero.

    Notes
    -----
    The twist of a revolute coordinate with axis z through o is (z x (p - o), z), of a prismatic one (z, 0): screw theory.
    """
    components, batch = _component_first(coordinates)
    size = components.shape[1]
    shapes = ((3,), (3, 3), (6, chain.coordinates))
    if out is None:
        results = [np.empty((*shape, size)) for shape in shapes]
    else:
        results = [_component_first_view(array, len(shape)) for array, shape in zip(out, shapes, strict=True)]
    position, rotation, jacobian = results
    for part in _blocks(size):
        ((axes, origin),), screws = _sweep(chain, components[:, part], [point])
        _store_pose(axes, origin, position[:, part], rotation[:, :, part])
        _store_twists(screws, point.after, origin, jacobian[:, :, part])
    return _batch_first(position, batch), _batch_first(rotation, batch), _batch_first(jacobian, batch)


def poses_and_jacobians_of_points(chain, coordinates, points):
    """Poses and Jacobians of several measuring points in one walk along the chain.

    Parameters
    ----------
    chain, coordinates
        As in `poses_and_jacobians`.
    points : sequence of MeasuringPoint

    Returns
    -------
    position : ndarray (T, ..., 3)
    rotation : ndarray (T, ..., 3, 3)
    jacobian : ndarray (T, ..., 6, n)
    """
    components, batch = _component_first(coordinates)
    size, shapes = components.shape[1], ((3,), (3, 3), (6, chain.coordinates))
    position, rotation, jacobian = (np.empty((len(points), *shape, size)) for shape in shapes)
    for part in _blocks(size):
        frames, screws = _sweep(chain, components[:, part], points)
        for number, (axes, origin) in enumerate(frames):
            _store_pose(axes, origin, position[number, :, part], rotation[number, :, :, part])
            _store_twists(screws, points[number].after, origin, jacobian[number, :, :, part])
    return tuple(_each_batch_first(array, batch) for array in (position, rotation, jacobian))


def jacobians(chain, coordinates, point):
    """Geometric Jacobian of a measuring point, where its pose is not needed.

    Parameters
    ----------
    chain, coordinates, point
        As in `poses_and_jacobians`.

    Returns
    -------
    ndarray (..., 6, n)
        The last of what `poses_and_jacobians` returns.
    """
    components, batch = _component_first(coordinates)
    jacobian = np.empty((6, chain.coordinates, components.shape[1]))
    for part in _blocks(components.shape[1]):
        ((_, origin),), screws = _sweep(chain, components[:, part], [point])
        _store_twists(screws, point.after, origin, jacobian[:, :, part])
    return _batch_first(jacobian, batch)


def rotation_vectors(rotation):
    """Rotation vectors of rotation matrices, for angles below pi.

    Parameters
    ----------
    rotation : ndarray (..., 3, 3)

    Returns
    -------
    ndarray (..., 3)
        rad.
    """
    skew = 0.5 * np.stack(
        [
            rotation[..., 2, 1] - rotation[..., 1, 2],
            rotation[..., 0, 2] - rotation[..., 2, 0],
            rotation[..., 1, 0] - rotation[..., 0, 1],
        ]
    )
    sine = np.sqrt((skew**2).sum(axis=0))
    cosine = 0.5 * (rotation[..., 0, 0] + rotation[..., 1, 1] + rotation[..., 2, 2] - 1.0)
    angle = np.arctan2(sine, cosine)
    scale = np.divide(angle, sine, out=np.ones_like(sine), where=sine > 0)
    return np.moveaxis(skew * scale, 0, -1)


def pose_differences(position, rotation, position_0, rotation_0):
    """How far one pose is from another: displacement (m) and rotation vector (rad), both in base axes.

    Parameters
    ----------
    position, position_0 : ndarray (..., 3)
    rotation, rotation_0 : ndarray (..., 3, 3)

    Returns
    -------
    ndarray (..., 6)
        Memory is component first.
    """
    relative = np.empty((3, 3, *position.shape[:-1]))
    for i in range(3):
        for j in range(3):
            relative[i, j] = sum(rotation[..., i, k] * rotation_0[..., j, k] for k in range(3))
    turn = rotation_vectors(np.moveaxis(relative, (0, 1), (-2, -1)))
    difference = np.empty((6, *position.shape[:-1]))
    difference[:3] = np.moveaxis(position - position_0, -1, 0)
    difference[3:] = np.moveaxis(turn, -1, 0)
    return np.moveaxis(difference, 0, -1)


def _component_first(coordinates):
    coordinates = np.asarray(coordinates, float)
    batch = coordinates.shape[:-1]
    return np.moveaxis(coordinates, -1, 0).reshape(coordinates.shape[-1], -1), batch


def _component_first_view(array, axes):
    """Memory of a result of this module, component first."""
    components = np.moveaxis(array, range(-axes, 0), range(axes))
    return components.reshape(*components.shape[:axes], -1)


def _batch_first(components, batch):
    shape = components.shape[:-1]
    components = components.reshape(*shape, *batch)
    return np.moveaxis(components, range(len(shape)), range(-len(shape), 0))


def _each_batch_first(components, batch):
    """As `_batch_first`, behind an axis of points."""
    shape = components.shape[1:-1]
    components = components.reshape(len(components), *shape, *batch)
    return np.moveaxis(components, range(1, 1 + len(shape)), range(-len(shape), 0))


def _blocks(size):
    return [slice(start, min(start + BLOCK, size)) for start in range(0, size, BLOCK)]


@dataclass(frozen=True, slots=True)
class _Screw:
    """A moving transform: its place in the chain, and its axis; the origin is none where points behind it can only turn."""

    place: int
    kind: str
    sign: float
    axis: list
    origin: list
    coordinate: int


def _sweep(chain, coordinates, points, lines=False):
    """Walk the chain up to the last of the points.

    Gives axes and target of each point, and the screw of each moving transform on the way. Without ``lines`` the origin of a
    screw is none where all points behind lie on the axis and only turn; with them the walk goes on to the end of the chain.
    """
    transforms = chain.transforms if lines else chain.transforms[: max(point.after for point in points)]
    # Springs that no configuration moves cost nothing.
    still = set(np.flatnonzero(~coordinates.any(axis=1)).tolist())
    rotations = [transform for transform in transforms if transform.kind == "R" and transform.coordinate not in still]
    turns = iter(_cosines_and_sines(coordinates, rotations))
    axes = before_turns = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
    origin, turned_about = [0.0, 0.0, 0.0], None
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
            screws.append(_Screw(number, transform.kind, sign, axes[axis], origin if moves else None, coordinate))
        if coordinate in still:
            pass
        elif transform.kind == "T":
            amount = transform.constant if coordinate is None else _product(sign, coordinates[coordinate])
            origin = _moved(origin, amount, axes[axis])
        else:
            if axis != turned_about:
                before_turns, turned_about = axes, axis
            axes = _turned(before_turns, axis, *next(turns))
        frames[number + 1] = (axes, origin)
    return [(frames[point.after][0], _offset(*frames[point.after], point.offset_m)) for point in points], screws


def _offset(axes, origin, offset_m):
    for axis, length in zip(axes, offset_m, strict=True):
        origin = _moved(origin, length, axis)
    return origin


def _lies_on(axis, transforms, point):
    """Whether transforms along and about one axis are all that lies between this axis and the point."""
    offset = [length for direction, length in enumerate(point.offset_m) if direction != axis]
    return not any(offset) and all(transform.axis == axis for transform in transforms)


def _cosines_and_sines(coordinates, rotations):
    """Cosine and sine of each rotation, counted from the first of those before it that turn about the same axis."""
    angles, turned_about = [], None
    for rotation in rotations:
        angle = rotation.constant if rotation.coordinate is None else _product(rotation.sign, coordinates[rotation.coordinate])
        angles.append(angles[-1] + angle if rotation.axis == turned_about else angle)
        turned_about = rotation.axis
    moving = iter(_cosines_and_sines_of_arrays([angle for angle in angles if type(angle) is not float], coordinates.shape[1]))
    return [(math.cos(angle), math.sin(angle)) if type(angle) is float else next(moving) for angle in angles]


def _cosines_and_sines_of_arrays(angles, size):
    """By the tangent of half the angle, which is faster in numpy than either of them."""
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


def _turned(axes, about, cosine, sine):
    """Axes of a frame after it has turned about one of them."""
    second, third = axes[about - 2], axes[about - 1]
    axes = list(axes)
    axes[about - 2] = [_product_sum(cosine, a, sine, b) for a, b in zip(second, third, strict=True)]
    axes[about - 1] = [_product_difference(cosine, b, sine, a) for a, b in zip(second, third, strict=True)]
    return axes


def _moved(origin, amount, axis):
    return [_product_sum(amount, a, 1.0, o) for o, a in zip(origin, axis, strict=True)]


def _store_pose(axes, origin, position, rotation):
    for i in range(3):
        position[i] = origin[i]
        for j in range(3):
            rotation[i, j] = axes[j][i]


def _store_twists(screws, after, target, jacobian):
    """Columns of a Jacobian; a coordinate that moves several transforms has the sum of their twists."""
    levers, filled = {}, set()
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


def _store_twist(screw, target, levers, twist):
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
            levers[id(origin)] = [_product_difference(1.0, p, 1.0, o) for p, o in zip(target, origin, strict=True)]
        _store_cross(axis, levers[id(origin)], linear)
        _store(axis, angular)
    if screw.sign < 0:
        twist *= -1.0


def _store(vector, out):
    for component, place in zip(vector, out, strict=True):
        place[:] = component


def _store_cross(a, b, out):
    for i, place in enumerate(out):
        np.subtract(_product(a[i - 2], b[i - 1]), _product(a[i - 1], b[i - 2]), out=place)


def _product(a, b):
    if type(a) is float:
        if a == 0.0:
            return 0.0
        if a == 1.0:
            return b
    if type(b) is float:
        if b == 0.0:
            return 0.0
        if b == 1.0:
            return a
    return a * b


def _product_sum(a, b, c, d):
    """a b + c d; the sum reuses the memory of a product that nobody else holds."""
    first, second = _product(a, b), _product(c, d)
    if type(second) is float and second == 0.0:
        return first
    if type(first) is float:
        return second if first == 0.0 else first + second
    if first is a or first is b:
        return first + second
    first += second
    return first


def _product_difference(a, b, c, d):
    """a b - c d; the difference reuses the memory of a product that nobody else holds."""
    first, second = _product(a, b), _product(c, d)
    if type(second) is float and second == 0.0:
        return first
    if type(first) is float:
        return -second if first == 0.0 else first - second
    if first is a or first is b:
        return first - second
    first -= second
    return first
