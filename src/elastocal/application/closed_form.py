"""All postures of an arm with six revolute joints for wanted poses, in closed form.

Two kinds of arms have a closed form here; in both, axes 2 and 3 are parallel. In the
first kind, the last three axes intersect in the wrist centre, whose position depends on
the first three joints alone; the other three joints rotate the tool about it [1]. In the
second kind, as in most collaborative arms, axis 4 is parallel to axes 2 and 3 too, and
axes 5 and 6 intersect. The three parallel axes move this intersection in one plane, which
determines joint 1 first [2]. Axes are given in base axes for the robot at zero angles
(product of exponentials), and the equations are Paden and Kahan's subproblems [3].

If the axes satisfy these conditions only approximately, for example after a calibration,
the nearest arm with a closed form is solved; Newton's method has to start from its
solutions.

References
----------
[1] Pieper, D. L., The Kinematics of Manipulators under Computer Control, Stanford
    University, 1968.
[2] Elias, A. J. and Wen, J. T., IK-Geo: Unified robot inverse kinematics using
    subproblem decomposition, Mechanism and Machine Theory 209, 2025.
[3] Murray, R. M., Li, Z. and Sastry, S. S., A Mathematical Introduction to Robotic
    Manipulation, section 3.3, CRC Press, 1994.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from elastocal.mechanics.kinematics import compute_poses, locate_joint_axes

if TYPE_CHECKING:
    from elastocal.mechanics.chain import Chain

# Largest distance (m) of axes from their intersection, and largest sine of the angle
# between parallel axes: these are zero but for rounding in an exact arm.
_ROUNDING = 1e-9
# The same for an arm that is approximately of one of these kinds: several times the
# deviations that calibrations find.
_NEARLY = 0.02
# Least sine of the angle between axes that must not be parallel.
_CROSSED = 0.5
# A cosine beyond 1 by less belongs to a stretched arm, by more to an unreachable pose;
# first of an exact arm, then of one that is nearly so.
_COSINE_ROUNDING = 1e-9
_COSINE_NEARLY = 0.05
# The wrist is aligned, and its angle arbitrary, if the sine of joint 5 is below this.
_ALIGNED = 1e-6


@dataclass(frozen=True)
class ClosedFormArm(ABC):
    """An arm of six revolute joints with a closed form, at zero angles.

    Attributes
    ----------
    points : (6, 3) a point on each axis, m, base axes.
    axes : (6, 3) directions of positive rotation; parallel ones are exactly parallel.
    centre : (3,) intersection of the last axes, m.
    position, rotation : (3,), m, and (3, 3) pose of the end effector.
    is_exact : whether the axes are those of the chain, but for rounding.
    """

    points: np.ndarray
    axes: np.ndarray
    centre: np.ndarray
    position: np.ndarray
    rotation: np.ndarray
    is_exact: bool

    @abstractmethod
    def _solve(
        self, turn: np.ndarray, centre: np.ndarray
    ) -> tuple[list[np.ndarray], np.ndarray]:
        """Solve for the six angles, each (.., N) with up to three axes of two sides
        before, from rotations (N, 3, 3) from zero angles and wanted centres (N, 3);
        also returns whether the pose is reached."""

    def solve_all_postures(
        self, position: np.ndarray, rotation: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Solve for the joint angles of the eight postures: two sides of axis 1, two of
        the elbow, and two of the wrist.

        In a singular posture, in which infinitely many angles reach the pose, one of
        them is a solution.

        Parameters
        ----------
        position, rotation : (N, 3), m, and (N, 3, 3) wanted poses of the end effector,
            base axes.

        Returns
        -------
        angles : (8, N, 6) rad.
        is_reached : (8, N) bool, postures in which the arm reaches the pose.
        """
        turn = rotation @ self.rotation.T
        centre = position + turn @ (self.centre - self.position)
        postures, reached = self._solve(turn, centre)
        angles = np.stack(np.broadcast_arrays(*postures), axis=-1)
        is_reached = np.broadcast_to(reached, angles.shape[:-1])
        return angles.reshape(8, -1, 6), is_reached.reshape(8, -1)

    def _solve_component(
        self,
        axis: np.ndarray,
        vector: np.ndarray,
        direction: np.ndarray,
        component: np.ndarray,
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
        beyond = _COSINE_ROUNDING if self.is_exact else _COSINE_NEARLY
        return angle, np.abs(ratio) <= 1.0 + beyond

    def _solve_joint_1(self, centre: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Solve for the angles (2, N) of joint 1 for centres (N, 3); also returns whether
        they are within reach."""
        # The parallel axes do not move the centre along them, so axis 1 has to.
        along = self.axes[1] @ (self.centre - self.points[0])
        return self._solve_component(
            self.axes[0], self.axes[1], centre - self.points[0], along
        )

    def _solve_elbow(
        self, tip: np.ndarray, wanted: np.ndarray
    ) -> tuple[list[np.ndarray], np.ndarray]:
        """Solve for the angles (2, ...) of joints 2 and 3 that move a point (3,) to
        wanted ones (..., 3); also returns whether they are within reach."""
        # The elbow sets the distance of the point from the shoulder.
        from_shoulder = wanted - self.points[1]
        upper_arm = self.points[2] - self.points[1]
        forearm = tip - self.points[2]
        squares = _square(from_shoulder) - _square(upper_arm) - _square(forearm)
        angle_3, is_near = self._solve_component(
            self.axes[2], forearm, upper_arm, 0.5 * squares
        )
        unturned = _rotate(self.axes[2], angle_3, forearm) + upper_arm
        angle_2 = _measure_angle(self.axes[1], unturned, from_shoulder)
        return [angle_2, angle_3], is_near


def find_closed_form(chain: Chain) -> ClosedFormArm | None:
    """Describe the arm that a chain is, exactly or nearly; None if it has no closed form
    here."""
    if chain.coordinates != 6 or any(chain.prismatic):
        return None
    zero = np.zeros(6)
    points, axes = locate_joint_axes(chain, zero).transpose(1, 0, 2)
    axes = axes * [[t.sign] for t in chain.transforms if t.coordinate is not None]
    pose = compute_poses(chain, zero, chain.end_effector)
    sines = np.linalg.norm(np.cross(axes[:-1], axes[1:]), axis=1)
    candidates: list[tuple[float, ClosedFormArm]] = []
    for kind, first, parallel, crossed in (
        (SphericalWristArm, 3, [1], [3, 4]),
        (ParallelAxesArm, 4, [1, 2], [0, 3, 4]),
    ):
        centre, distance = _intersect(points[first:], axes[first:])
        largest = max(distance, sines[parallel].max())
        if largest <= _NEARLY and sines[crossed].min() >= _CROSSED:
            aligned = _align(axes, slice(1, 2 + len(parallel)))
            arm = kind(points, aligned, centre, *pose, largest <= _ROUNDING)
            candidates.append((largest, arm))
    return min(candidates, key=lambda candidate: candidate[0], default=(0.0, None))[1]


def _intersect(points: np.ndarray, axes: np.ndarray) -> tuple[np.ndarray, float]:
    """Find the point (3,) with the least squared distances from K axes, and the largest
    of these distances, m."""
    across = np.eye(3) - axes[:, :, None] * axes[:, None, :]
    offsets = across @ points[..., None]
    centre = np.linalg.lstsq(across.reshape(-1, 3), offsets.ravel())[0]
    distances = np.linalg.norm(across @ centre - offsets[..., 0], axis=1)
    return centre, float(distances.max())


def _align(axes: np.ndarray, chosen: slice) -> np.ndarray:
    """Make some of the axes exactly parallel, each with its sense."""
    senses = np.sign(axes[chosen] @ axes[chosen.start])[:, None]
    mean = (senses * axes[chosen]).sum(axis=0)
    aligned = axes.copy()
    aligned[chosen] = senses * mean / np.linalg.norm(mean)
    return aligned


class SphericalWristArm(ClosedFormArm):
    """An arm whose last three axes intersect, and whose axes 2 and 3 are parallel."""

    def _solve(
        self, turn: np.ndarray, centre: np.ndarray
    ) -> tuple[list[np.ndarray], np.ndarray]:
        first_angles, is_placed = self._solve_first_joints(centre)
        wrist_angles, is_turned = self._solve_wrist(turn, first_angles)
        return [*first_angles, *wrist_angles], is_placed & is_turned

    def _solve_first_joints(
        self, centre: np.ndarray
    ) -> tuple[list[np.ndarray], np.ndarray]:
        """Solve for the angles (2, 2, N) of joints 1 to 3, elbow and side of axis 1,
        that place the wrist centre at (N, 3); also returns whether they do."""
        angle_1, is_beside = self._solve_joint_1(centre)
        from_base = centre - self.points[0]
        unturned = _rotate(self.axes[0], -angle_1, from_base) + self.points[0]
        elbow, is_near = self._solve_elbow(self.centre, unturned)
        return [angle_1, *elbow], is_beside & is_near

    def _solve_wrist(
        self, turn: np.ndarray, first_angles: list[np.ndarray]
    ) -> tuple[list[np.ndarray], np.ndarray]:
        """Solve for the angles (2, 2, 2, N) of joints 4 to 6, with the side of the wrist
        in front, that complete rotations (N, 3, 3) from zero angles; also returns
        whether they do."""
        axis_4, axis_5, axis_6 = self.axes[3:]
        # Directions to which the wrist alone has to rotate axes 6 and 5.
        wanted_6 = turn @ axis_6
        wanted_5 = turn @ axis_5
        for axis, angle in zip(self.axes, first_angles, strict=False):
            wanted_6 = _rotate(axis, -angle, wanted_6)
            wanted_5 = _rotate(axis, -angle, wanted_5)
        angle_5, is_turned = self._solve_component(
            axis_5, axis_6, axis_4, wanted_6 @ axis_4
        )
        angle_4 = _measure_angle(axis_4, _rotate(axis_5, angle_5, axis_6), wanted_6)
        wanted_5 = _rotate(axis_5, -angle_5, _rotate(axis_4, -angle_4, wanted_5))
        angle_6 = _measure_angle(axis_6, axis_5, wanted_5)
        return [angle_4, angle_5, angle_6], is_turned


class ParallelAxesArm(ClosedFormArm):
    """An arm whose axes 2, 3 and 4 are parallel, and whose axes 5 and 6 intersect."""

    def _solve(
        self, turn: np.ndarray, centre: np.ndarray
    ) -> tuple[list[np.ndarray], np.ndarray]:
        axis_1 = self.axes[0]
        angle_1, is_beside = self._solve_joint_1(centre)
        wrist, is_turned, is_aligned = self._solve_wrist(turn, angle_1)
        # Joint 1 before the parallel axes and the wrist behind them are undone.
        lever = self._carry_without_wrist(turn, wrist, self.points[3] - self.centre)
        wanted = _rotate(axis_1, -angle_1, centre + lever - self.points[0])
        wanted += self.points[0]
        elbow, is_near = self._solve_elbow(self.points[3], wanted)
        reference = self._carry_without_wrist(turn, wrist, axis_1)
        for axis, angle in zip(self.axes, [angle_1, *elbow], strict=False):
            reference = _rotate(axis, -angle, reference)
        angle_4 = _measure_angle(self.axes[3], axis_1, reference)
        # With an aligned wrist the arbitrary angle of joint 6 decides how far the elbow
        # has to reach, so a failure shows nothing.
        is_reached = is_beside & is_turned & (is_near | is_aligned)
        return [angle_1, *elbow, angle_4, *wrist], is_reached

    def _carry_without_wrist(
        self, turn: np.ndarray, wrist: list[np.ndarray], vector: np.ndarray
    ) -> np.ndarray:
        """Turn a vector (3,) as joints 1 to 4 do if all joints turn the end effector by
        `turn`, and joints 5 and 6 by the angles (2, 2, N) of the wrist."""
        for axis, angle in zip(self.axes[4:], wrist, strict=True):
            vector = _rotate(axis, -angle, vector)
        return _apply(turn, vector)

    def _solve_wrist(
        self, turn: np.ndarray, angle_1: np.ndarray
    ) -> tuple[list[np.ndarray], np.ndarray, np.ndarray]:
        """Solve for the angles (2, 2, N) of joints 5 and 6, with the side of the wrist in
        front; also returns whether they turn the end effector by `turn` and whether the
        wrist is aligned."""
        axis_1, parallel = self.axes[:2]
        axis_5, axis_6 = self.axes[4:]
        # The parallel axes do not change components along them.
        wanted_6 = _rotate(axis_1, -angle_1, turn @ axis_6)
        angle_5, is_turned = self._solve_component(
            axis_5, axis_6, parallel, wanted_6 @ parallel
        )
        # Nor do they turn their own direction, which joints 5 and 6 bring to where the
        # end effector carries it.
        carried = _apply(turn.transpose(0, 2, 1), _rotate(axis_1, angle_1, parallel))
        angle_6 = _measure_angle(axis_6, carried, _rotate(axis_5, -angle_5, parallel))
        sine = np.linalg.norm(np.cross(parallel, wanted_6), axis=-1)
        return [angle_5, angle_6], is_turned, sine < _ALIGNED


def _apply(rotation: np.ndarray, vector: np.ndarray) -> np.ndarray:
    """Apply rotations (N, 3, 3) to vectors (..., N, 3)."""
    return (rotation @ vector[..., None])[..., 0]


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
