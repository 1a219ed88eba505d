"""All postures of an arm with a spherical wrist for wanted poses, in closed form.

The last three of six revolute axes intersect in the wrist centre, which the first three
joints alone place; the wrist then turns what it holds [1]. Axes 2 and 3 are parallel,
as those of nearly all industrial robots are. Axes are those of the robot at zero
angles, in base axes (product of exponentials), and the equations are Paden and Kahan's
subproblems [2].

References
----------
[1] Pieper, D. L., The Kinematics of Manipulators under Computer Control, Stanford
    University, 1968.
[2] Murray, R. M., Li, Z. and Sastry, S. S., A Mathematical Introduction to Robotic
    Manipulation, section 3.3, CRC Press, 1994.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from elastocal.mechanics.kinematics import compute_poses, locate_joint_axes

if TYPE_CHECKING:
    from elastocal.mechanics.chain import Chain

# Largest distance (m) of the last three axes from their centre, and largest sine of the
# angle between axes 2 and 3: these are zero but for rounding, or the arm is another one.
_ROUNDING = 1e-9
# A cosine beyond 1 by less belongs to a stretched arm, by more to an unreachable pose.
_COSINE_ROUNDING = 1e-9


@dataclass(frozen=True)
class SphericalWristArm:
    """An arm of six revolute joints with a spherical wrist, at zero angles.

    Attributes
    ----------
    points : (6, 3) a point on each axis, m, base axes.
    axes : (6, 3) directions of positive rotation.
    wrist_centre : (3,) intersection of the last three axes, m.
    position, rotation : (3,), m, and (3, 3) pose of the end effector.
    """

    points: np.ndarray
    axes: np.ndarray
    wrist_centre: np.ndarray
    position: np.ndarray
    rotation: np.ndarray


def find_spherical_wrist(chain: Chain) -> SphericalWristArm | None:
    """Describe the arm if its last three axes intersect in one point and its axes 2 and
    3 are parallel; None if it is another one."""
    if chain.coordinates != 6 or any(chain.prismatic):
        return None
    zero = np.zeros(6)
    points, axes = locate_joint_axes(chain, zero).transpose(1, 0, 2)
    axes = axes * [[t.sign] for t in chain.transforms if t.coordinate is not None]
    # The wrist centre is the point with the least squared distances from the axes.
    across = np.eye(3) - axes[3:, :, None] * axes[3:, None, :]
    offsets = across @ points[3:, :, None]
    centre = np.linalg.lstsq(across.reshape(9, 3), offsets.ravel())[0]
    distances = np.linalg.norm(across @ centre - offsets[..., 0], axis=1)
    sines = np.linalg.norm(np.cross(axes[[1, 3, 4]], axes[[2, 4, 5]]), axis=1)
    if distances.max() > _ROUNDING or sines[0] > _ROUNDING or sines[1:].min() < 0.5:
        return None
    pose = compute_poses(chain, zero, chain.end_effector)
    return SphericalWristArm(points, axes, centre, *pose)


def solve_all_postures(
    arm: SphericalWristArm, position: np.ndarray, rotation: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Solve for the joint angles of the eight postures: two sides of axis 1, two of the
    elbow, and two of the wrist.

    In a singular posture, in which infinitely many angles reach the pose, one of them is
    a solution.

    Parameters
    ----------
    arm : the arm.
    position, rotation : (N, 3), m, and (N, 3, 3) wanted poses of the end effector, base
        axes.

    Returns
    -------
    angles : (8, N, 6) rad.
    is_reached : (8, N) bool, postures in which the arm reaches the pose.
    """
    # Rotations from zero angles, and the wrist centre that they need.
    turn = rotation @ arm.rotation.T
    centre = position + turn @ (arm.wrist_centre - arm.position)
    first_angles, is_placed = _solve_first_joints(arm, centre)
    wrist_angles, is_turned = _solve_wrist(arm, turn, first_angles)
    angles = np.stack(np.broadcast_arrays(*first_angles, *wrist_angles), axis=-1)
    is_reached = np.broadcast_to(is_placed & is_turned, angles.shape[:-1])
    return angles.reshape(8, -1, 6), is_reached.reshape(8, -1)


def _solve_first_joints(
    arm: SphericalWristArm, centre: np.ndarray
) -> tuple[list[np.ndarray], np.ndarray]:
    """Solve for the angles (2, 2, N) of joints 1 to 3, elbow and side of axis 1, that
    place the wrist centre at (N, 3); also returns whether they do."""
    axis_1, axis_2, axis_3 = arm.axes[:3]
    # Axes 2 and 3 do not move the wrist centre along them, so axis 1 has to.
    from_base = centre - arm.points[0]
    along = axis_2 @ (arm.wrist_centre - arm.points[0])
    angle_1, is_beside = _solve_component(axis_1, axis_2, from_base, along)
    # The elbow sets the distance of the wrist centre from the shoulder.
    from_shoulder = _rotate(axis_1, -angle_1, from_base) + arm.points[0] - arm.points[1]
    upper_arm = arm.points[2] - arm.points[1]
    forearm = arm.wrist_centre - arm.points[2]
    squares = _square(from_shoulder) - _square(upper_arm) - _square(forearm)
    angle_3, is_near = _solve_component(axis_3, forearm, upper_arm, 0.5 * squares)
    unturned = _rotate(axis_3, angle_3, forearm) + upper_arm
    angle_2 = _measure_angle(axis_2, unturned, from_shoulder)
    return [angle_1, angle_2, angle_3], is_beside & is_near


def _solve_wrist(
    arm: SphericalWristArm, turn: np.ndarray, first_angles: list[np.ndarray]
) -> tuple[list[np.ndarray], np.ndarray]:
    """Solve for the angles (2, 2, 2, N) of joints 4 to 6, with the side of the wrist in
    front, that complete rotations (N, 3, 3) from zero angles; also returns whether they
    do."""
    axis_4, axis_5, axis_6 = arm.axes[3:]
    # Where the wrist alone has to turn axis 6 and, beside it, axis 5.
    wanted_6 = turn @ axis_6
    wanted_5 = turn @ axis_5
    for axis, angle in zip(arm.axes, first_angles, strict=False):
        wanted_6 = _rotate(axis, -angle, wanted_6)
        wanted_5 = _rotate(axis, -angle, wanted_5)
    angle_5, is_turned = _solve_component(axis_5, axis_6, axis_4, wanted_6 @ axis_4)
    angle_4 = _measure_angle(axis_4, _rotate(axis_5, angle_5, axis_6), wanted_6)
    wanted_5 = _rotate(axis_5, -angle_5, _rotate(axis_4, -angle_4, wanted_5))
    angle_6 = _measure_angle(axis_6, axis_5, wanted_5)
    return [angle_4, angle_5, angle_6], is_turned


def _rotate(axis: np.ndarray, angle: np.ndarray, vector: np.ndarray) -> np.ndarray:
    """Rotate vectors (..., 3) by angles (...) about an axis (3,), by Rodrigues'
    formula."""
    along = (vector @ axis)[..., None] * axis
    cosine = np.cos(angle)[..., None]
    sine = np.sin(angle)[..., None]
    return along + cosine * (vector - along) + sine * np.cross(axis, vector)


def _measure_angle(axis: np.ndarray, start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Measure the angle (...) about an axis (3,) from vectors (..., 3) to others; zero if
    they lie along the axis."""
    sine = np.cross(start, end) @ axis
    cosine = (start * end).sum(axis=-1) - (start @ axis) * (end @ axis)
    return np.arctan2(sine, cosine)


def _square(vector: np.ndarray) -> np.ndarray:
    return (vector**2).sum(axis=-1)


def _solve_component(
    axis: np.ndarray, vector: np.ndarray, direction: np.ndarray, component: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Solve direction' R(axis, angle) vector = component for the two angles.

    Parameters
    ----------
    axis, vector : (3,).
    direction : (..., 3).
    component : (...).

    Returns
    -------
    angle : (2, ...) rad; if there is no solution, the angle that comes nearest.
    is_solved : (...) bool.
    """
    along = direction @ axis * (axis @ vector)
    cosine = direction @ vector - along
    sine = direction @ np.cross(axis, vector)
    amplitude = np.maximum(np.hypot(cosine, sine), np.finfo(float).tiny)
    ratio = (component - along) / amplitude
    half = np.arccos(np.clip(ratio, -1.0, 1.0))
    middle = np.arctan2(sine, cosine)
    angle = np.stack(np.broadcast_arrays(middle + half, middle - half))
    return angle, np.abs(ratio) <= 1.0 + _COSINE_ROUNDING
