"""Corrected joint targets: commands for which the loaded, sagging, imperfect robot comes
to rest at the wanted poses.

They are found by Newton's method on the forward model of the calibrated robot, with the
Jacobian of the rigid chain (a simplified Newton method [1]). The error of this Jacobian
is the robot's deviation over its reach, some 1 / 500, and each step reduces the pose
error by this factor. For comparison, the errors of uncorrected targets are predicted,
which are those of the rigid robot of the file [2].

[1] Deuflhard, P., Newton Methods for Nonlinear Problems, section 2.1.2, Springer, 2011.
[2] Mooring, B. W., Roth, Z. S. and Driels, M. R., Fundamentals of Manipulator
Calibration, chapter 7, Wiley, 1991.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING

import numpy as np

from elastocal.application.calibrated import (
    find_equilibrium,
    predict_residual_displacements,
    split_into_chunks,
)
from elastocal.application.inverse_kinematics import (
    SINGULAR_DETERMINANT,
    SOLVED_M,
    compute_allowed_steps,
    compute_determinants,
    compute_reach_m,
    find_beyond_limits,
    find_turning_joints,
    solve_path,
    solve_poses,
)
from elastocal.exchange.target_path import OK
from elastocal.mechanics.kinematics import compute_jacobians, compute_pose_differences

if TYPE_CHECKING:
    from elastocal.application.calibrated import CalibratedRobot
    from elastocal.mechanics.robot import Robot

OUTSIDE_LIMITS = "outside limits"
UNREACHABLE = "unreachable"
SINGULAR = "singular"
OTHER_POSTURE = "not in the stated posture"
# Upper bound on Newton's steps. Each reduces the error to a five-hundredth, and less
# near singular postures.
_STEPS = 8
# Steps after which the regression's displacement is evaluated again. Each reduces its
# error to a thousandth; a regression with jumps would keep later steps from converging.
_REGRESSION_STEPS = 2
# Largest pose error of a converged target: far below the repeatability of any robot.
_CONVERGED_M = 1e-9
# A correction turns joints by milliradians. A larger change (rad, or m) means that the
# robot is near a singular posture, and that the correction is another posture.
_LARGEST_CORRECTION = 0.1
# A posture counts as the stated one if every joint stays within this angle (rad), or
# within this share of the reach. One stated posture can then stand for a stretch of a
# path, while other postures differ by more or lie behind a singular one.
_POSTURE_RAD = np.radians(45.0)


@dataclass(frozen=True)
class Correction:
    """Joint targets for N wanted poses.

    Attributes
    ----------
    joint_angles : (N, n) corrected commands, as the controller reports them, rad.
    uncorrected : (N, n) commands of the rigid robot of the file, rad.
    error_before, error_after : (N, 6) wanted less predicted pose without and with the
        correction, displacement in m and rotation vector in rad, base axes. Module
        `accuracy` predicts how far they are from the real errors.
    status : (N,) of str: "ok", "outside limits", "unreachable", "singular" or "not in
        the stated posture".
    """

    joint_angles: np.ndarray
    uncorrected: np.ndarray
    error_before: np.ndarray
    error_after: np.ndarray
    status: np.ndarray

    def select(self, chosen: np.ndarray) -> Correction:
        """Select poses by an (N,) bool array."""
        return Correction(
            self.joint_angles[chosen],
            self.uncorrected[chosen],
            self.error_before[chosen],
            self.error_after[chosen],
            self.status[chosen],
        )


@dataclass(frozen=True)
class _NominalTargets:
    """Wanted poses of the end effector with the joint angles of the rigid robot.

    Attributes
    ----------
    position, rotation : (N, 3), m, and (N, 3, 3), base axes.
    wrench : (N, 6), N and N m.
    angles : (N, n) angles of the chain, rad.
    residual_m : (N,) pose error of the rigid robot at these angles, m.
    """

    position: np.ndarray
    rotation: np.ndarray
    wrench: np.ndarray
    angles: np.ndarray
    residual_m: np.ndarray

    @property
    def is_reached(self) -> np.ndarray:
        """(N,) bool, poses that the rigid robot reaches."""
        return self.residual_m <= SOLVED_M

    def select(self, rows: slice | np.ndarray) -> _NominalTargets:
        return _NominalTargets(
            self.position[rows],
            self.rotation[rows],
            self.wrench[rows],
            self.angles[rows],
            self.residual_m[rows],
        )


def find_joint_targets(
    calibrated: CalibratedRobot,
    position: np.ndarray,
    rotation: np.ndarray,
    wrench: np.ndarray,
    start: np.ndarray | None = None,
) -> Correction:
    """Find joint targets that bring the end effector to wanted poses.

    Parameters
    ----------
    calibrated : robot with six joints or more. With more, the joints move as little as
        possible away from the solution of the rigid robot.
    position, rotation : (N, 3), m, and (N, 3, 3) wanted poses of the last measuring
        point, base axes.
    wrench : (N, 6) loads there, N and N m, base axes.
    start : (N, n) joint angles near each target, as the controller reports them, rad.
        Their posture and turns are kept, or the target gets the status "not in the
        stated posture". None chooses both for the path as a whole, see `solve_path`.
    """
    robot = calibrated.robot
    in_other_posture = np.zeros(len(position), bool)
    if start is None:
        angles, residual_m = solve_path(robot, position, rotation)
    else:
        stated = robot.model_angles(start)
        angles, residual_m = solve_poses(robot, position, rotation, stated)
        turns = np.round((angles - stated) / (2 * np.pi))
        angles -= np.where(find_turning_joints(robot), 2 * np.pi * turns, 0.0)
        in_other_posture = _find_other_postures(robot, stated, angles)
    targets = _NominalTargets(position, rotation, wrench, angles, residual_m)
    chunks = [targets.select(rows) for rows in split_into_chunks(len(position))]
    with ThreadPoolExecutor(2) as pool:
        corrections = [
            *pool.map(lambda chunk: _correct_chunk(calibrated, chunk), chunks)
        ]
    arrays = {}
    for field in fields(Correction):
        arrays[field.name] = np.concatenate(
            [getattr(correction, field.name) for correction in corrections]
        )
    reached = arrays["status"] != UNREACHABLE
    arrays["status"][in_other_posture & reached] = OTHER_POSTURE
    return Correction(**arrays)


def _find_other_postures(
    robot: Robot, stated: np.ndarray, solution: np.ndarray
) -> np.ndarray:
    """Find solutions that are not in the stated posture.

    They are far from it or, with six joints, behind a singular posture. Takes angles
    (N, n) of the chain, returns (N,) bool.
    """
    largest = np.where(robot.chain.prismatic, compute_reach_m(robot), 1.0)
    is_far = (np.abs(solution - stated) > largest * _POSTURE_RAD).any(axis=1)
    if robot.commands != 6:
        return np.asarray(is_far)
    sides = _find_side(robot, stated) * _find_side(robot, solution)
    return np.asarray(is_far | (sides < 0))


def _find_side(robot: Robot, angles: np.ndarray) -> np.ndarray:
    """Return the sign of the Jacobian's determinant at angles (N, 6), 0 if singular."""
    determinants = compute_determinants(robot, angles)
    is_singular = np.abs(determinants) < SINGULAR_DETERMINANT
    return np.where(is_singular, 0.0, np.sign(determinants))


@dataclass(frozen=True)
class LargeStep:
    """A joint that moves too far from one target to the next.

    Attributes
    ----------
    row : number of the target to which it moves, from 0.
    joint : number of the joint, from 0.
    size, allowed : size of the step and largest allowed size, rad (m if prismatic).
    """

    row: int
    joint: int
    size: float
    allowed: float


def find_large_steps(
    robot: Robot, position: np.ndarray, rotation: np.ndarray, joint_angles: np.ndarray
) -> list[LargeStep]:
    """Find steps from pose to pose that are larger than `compute_allowed_steps`.

    Parameters
    ----------
    robot : the robot.
    position, rotation : (N, 3), m, and (N, 3, 3) poses of the path, base axes.
    joint_angles : (N, n) commands, as the controller reports them, rad.
    """
    steps = np.abs(np.diff(robot.model_angles(joint_angles), axis=0))
    allowed = compute_allowed_steps(robot, position, rotation)
    return [
        LargeStep(row + 1, joint, steps[row, joint], allowed[row, joint])
        for row, joint in np.argwhere(steps > allowed).tolist()
    ]


@dataclass(frozen=True)
class _Equilibria:
    """Where the robot comes to rest at K commands.

    Attributes
    ----------
    coordinates : (K, C) coordinates of its sites.
    displacement : (K, 3) displacement by the regression on the residuals, m.
    error : (K, 6) wanted less predicted pose, m and rad.
    """

    coordinates: np.ndarray
    displacement: np.ndarray
    error: np.ndarray


def _correct_chunk(calibrated: CalibratedRobot, targets: _NominalTargets) -> Correction:
    """Correct targets by Newton's method from the solution of the rigid robot."""
    robot = calibrated.robot
    uncorrected = robot.reported_angles(targets.angles)
    current = _find_equilibria(calibrated, targets, uncorrected)
    error_before = current.error.copy()
    jacobian = compute_jacobians(robot.chain, targets.angles, robot.chain.end_effector)
    inverse = np.linalg.pinv(robot.restrict_jacobians(jacobian))
    angles = targets.angles.copy()
    is_singular = np.zeros(len(angles), bool)
    # Only these rows need another step. Most of them are near singular postures.
    rows = np.flatnonzero(targets.is_reached)
    for iteration in range(_STEPS):
        step = robot.expand_steps(
            (inverse[rows] @ current.error[rows, :, None])[..., 0]
        )
        change = np.abs(angles[rows] + step - targets.angles[rows]).max(axis=1)
        is_small = change <= _LARGEST_CORRECTION
        is_singular[rows[~is_small]] = True
        rows = rows[is_small]
        angles[rows] += step[is_small]
        current.coordinates[rows, : robot.joints] += step[is_small]
        updated = _find_equilibria(
            calibrated,
            targets.select(rows),
            robot.reported_angles(angles[rows]),
            current.coordinates[rows],
            None if iteration < _REGRESSION_STEPS else current.displacement[rows],
        )
        current.coordinates[rows] = updated.coordinates
        current.displacement[rows] = updated.displacement
        current.error[rows] = updated.error
        rows = rows[_measure_length(robot, updated.error) > _CONVERGED_M]
        if not len(rows):
            break
    is_singular[rows] = True
    status = np.full(len(angles), OK, dtype=f"U{len(OTHER_POSTURE)}")
    status[is_singular] = SINGULAR
    status[find_beyond_limits(robot, angles).any(axis=1)] = OUTSIDE_LIMITS
    status[~targets.is_reached] = UNREACHABLE
    return Correction(
        robot.reported_angles(angles), uncorrected, error_before, current.error, status
    )


def _find_equilibria(
    calibrated: CalibratedRobot,
    targets: _NominalTargets,
    commands: np.ndarray,
    nearby_coordinates: np.ndarray | None = None,
    displacement: np.ndarray | None = None,
) -> _Equilibria:
    """Find where the robot comes to rest at commands (K, n), and its errors.

    `nearby_coordinates` are as in `find_equilibrium`; a `displacement` by the regression
    is taken as it is, instead of evaluated.
    """
    coordinates, position, rotation = find_equilibrium(
        calibrated, commands, targets.wrench, nearby_coordinates
    )
    if displacement is None:
        displacement = predict_residual_displacements(
            calibrated, commands, targets.wrench
        )
    error = compute_pose_differences(
        targets.position, targets.rotation, position + displacement, rotation
    )
    return _Equilibria(coordinates, displacement, error)


def _measure_length(robot: Robot, error: np.ndarray) -> np.ndarray:
    """Return the size of pose errors (N, 6), m; angles count as lengths at the reach."""
    scale = np.repeat([1.0, compute_reach_m(robot)], 3)
    return np.linalg.norm(error * scale, axis=1)
