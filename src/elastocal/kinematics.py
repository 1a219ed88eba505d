"""Equations 1-4: poses and geometric Jacobians of any measuring point, by screw theory, batched over any leading axes.

Arrays come and go with the batch in front, ``(..., 6, n)``, but lie in memory component first, so that every arithmetic step
runs along the batch; slices such as ``jacobian[..., 0, 2]`` are contiguous. Entries of the frame that a chain leaves at 0 or 1
for every configuration stay plain numbers and cost nothing.
"""

import math

import numpy as np

# So many configurations at a time keep all intermediate arrays in a second-level cache.
BLOCK = 8192


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
    components, batch = _component_first(coordinates)
    position, rotation = np.empty((3, components.shape[1])), np.empty((3, 3, components.shape[1]))
    for part in _blocks(components.shape[1]):
        axes, origin, _ = _sweep(chain, np.ascontiguousarray(components[:, part]), point)
        _store_pose(axes, origin, position[:, part], rotation[:, :, part])
    return _batch_first(position, batch), _batch_first(rotation, batch)


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
        axes, origin, screws = _sweep(chain, np.ascontiguousarray(components[:, part]), point)
        _store_pose(axes, origin, position[:, part], rotation[:, :, part])
        _store_twists(screws, origin, jacobian[:, :, part])
    return _batch_first(position, batch), _batch_first(rotation, batch), _batch_first(jacobian, batch)


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


def _blocks(size):
    return [slice(start, min(start + BLOCK, size)) for start in range(0, size, BLOCK)]


def _sweep(chain, coordinates, point):
    """Walk the chain up to `point`: axes of the frame, target, and (kind, sign, axis, origin) of each coordinate on the way."""
    transforms = chain.transforms[: point.after]
    turns = _cosines_and_sines(coordinates, [t.coordinate for t in transforms if t.kind == "R" and t.coordinate is not None])
    axes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
    origin = [0.0, 0.0, 0.0]
    screws = [None] * chain.coordinates
    for transform in transforms:
        axis, coordinate, sign = transform.axis, transform.coordinate, transform.sign
        if coordinate is not None:
            screws[coordinate] = (transform.kind, sign, axes[axis], origin)
        if transform.kind == "T":
            amount = transform.constant if coordinate is None else _product(sign, coordinates[coordinate])
            origin = _moved(origin, amount, axes[axis])
            continue
        if coordinate is None:
            cosine, sine = math.cos(transform.constant), math.sin(transform.constant)
        else:
            cosine, sine = turns[coordinate][0], _product(sign, turns[coordinate][1])
        second, third = axes[axis - 2], axes[axis - 1]
        axes = list(axes)
        axes[axis - 2] = [_product_sum(cosine, a, sine, b) for a, b in zip(second, third, strict=True)]
        axes[axis - 1] = [_product_difference(cosine, b, sine, a) for a, b in zip(second, third, strict=True)]
    for axis, length in zip(axes, point.offset_m, strict=True):
        origin = _moved(origin, length, axis)
    return axes, origin, screws


def _cosines_and_sines(coordinates, turning):
    """Cosine and sine of each turning coordinate by the tangent of its half, which is faster in numpy than either of them."""
    tangent = np.tan(0.5 * coordinates[turning])
    scale = tangent * tangent
    scale += 1.0
    np.divide(2.0, scale, out=scale)
    tangent *= scale
    scale -= 1.0
    return dict(zip(turning, zip(scale, tangent, strict=True), strict=True))


def _moved(origin, amount, axis):
    return [_product_sum(amount, a, 1.0, o) for o, a in zip(origin, axis, strict=True)]


def _store_pose(axes, origin, position, rotation):
    for i in range(3):
        position[i] = origin[i]
        for j in range(3):
            rotation[i, j] = axes[j][i]


def _store_twists(screws, target, jacobian):
    levers = {}
    for column, screw in enumerate(screws):
        if screw is None:
            jacobian[:, column] = 0.0
            continue
        kind, sign, axis, origin = screw
        if kind == "T":
            linear, angular = axis, [0.0, 0.0, 0.0]
        else:
            # Joints that meet in one point, as in a spherical wrist, share their lever.
            if id(origin) not in levers:
                levers[id(origin)] = [_product_difference(1.0, p, 1.0, o) for p, o in zip(target, origin, strict=True)]
            linear, angular = _cross(axis, levers[id(origin)]), axis
        for row in range(3):
            jacobian[row, column] = linear[row]
            jacobian[3 + row, column] = angular[row]
        if sign < 0:
            jacobian[:, column] *= -1.0


def _cross(a, b):
    return [_product_difference(a[i - 2], b[i - 1], a[i - 1], b[i - 2]) for i in range(3)]


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
