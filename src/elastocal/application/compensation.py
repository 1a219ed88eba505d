"""Corrected joint targets: what to command so that the loaded, sagging, imperfect robot
comes to rest at the wanted poses.

Newton's method on the forward model of the calibrated robot. The Jacobian is that of
the rigid chain, a simplified Newton method [1]: it errs by what the robot deviates over
its reach, some 1 / 500, and each step leaves so much less. The error of a target that
is commanded as the rigid robot of the file would have it is predicted beside it [2].

[1] Deuflhard, P., Newton Methods for Nonlinear Problems, section 2.1.2, Springer, 2011.
[2] Mooring, B. W., Roth, Z. S. and Driels, M. R., Fundamentals of Manipulator
Calibration, chapter 7, Wiley, 1991.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from elastocal.application.calibrated import come_to_rest, parts, regressed
from elastocal.application.inverse_kinematics import (
    SOLVED_M,
    allowed_steps,
    find_beyond_limits,
    reach_m,
    solve_path,
    solve_poses,
)
from elastocal.exchange.target_path import OK
from elastocal.mechanics.kinematics import jacobians, pose_differences

if TYPE_CHECKING:
    from elastocal.application.calibrated import CalibratedRobot
    from elastocal.mechanics.robot import Robot

OUTSIDE_LIMITS = "outside limits"
UNREACHABLE = "unreachable"
SINGULAR = "singular"
OTHER_POSTURE = "not in the stated posture"
# Newton's steps: each leaves a five-hundredth, and more near singular postures. What a
# regression adds is taken anew after the first so many of them: each leaves a
# thousandth of it, and what has jumps would keep others from settling.
_STEPS = 8
_REGRESSED = 2
# What may be left of a corrected target: far below any robot's repeatability.
_CORRECTED_M = 1e-9
# A correction turns joints by milliradians. Where one must turn by this much (rad, or
# m) the robot stands so near a singular posture that the correction is another posture.
_LARGEST_CORRECTION = 0.1
# A posture is kept where every joint stays within this of where it is stated (rad), or
# within so much of the reach: enough for one posture to stand for a stretch of a path,
# while other postures differ by more or lie behind a singular one.
_NEAR_RAD = np.radians(45.0)
# Determinants of the Jacobian, angles at the reach and over it, below which a posture
# is singular and on neither side.
_SINGULAR_DETERMINANT = 1e-6


@dataclass(frozen=True)
class Correction:
    """Joint targets for N wanted poses; lengths in m, angles in rad.

    `joint_angles` (N, n): to command, as the controller counts them. `uncorrected` (N,
    n): what the rigid robot of the file would be commanded. `error_before`,
    `error_after` (N, 6): wanted less predicted pose, displacement and rotation vector
    in base axes: uncorrected, and with the correction. How far both are from the truth
    `accuracy` says. `status` (N,) of str: "ok", "outside limits", "unreachable",
    "singular" or "not in the stated posture".
    """

    joint_angles: np.ndarray
    uncorrected: np.ndarray
    error_before: np.ndarray
    error_after: np.ndarray
    status: np.ndarray


def find_joint_targets(
    calibrated: CalibratedRobot,
    position: np.ndarray,
    rotation: np.ndarray,
    wrench: np.ndarray,
    start: np.ndarray | None = None,
) -> Correction:
    """Joint targets that bring the end effector to wanted poses.

    `calibrated`: of six joints or more; of more, joints move as little as possible from
    where the rigid robot would have them. `position`, `rotation` (N, 3), (N, 3, 3):
    wanted pose of the last measuring point, m, base axes. `wrench` (N, 6): N, N m,
    there, base axes. `start` (N, n): joint angles near which each target lies, as the
    controller reports them, rad: posture and turns are kept, or the target refused.
    Without, both are chosen for the path as a whole, see `along_path`.
    """
    robot = calibrated.robot
    if start is None:
        nominal, left = solve_path(robot, position, rotation)
        other = np.zeros(len(position), bool)
    else:
        near = robot.model_angles(start)
        nominal, left = solve_poses(robot, position, rotation, near)
        nominal -= np.where(
            robot.chain.prismatic,
            0.0,
            2 * np.pi * np.round((nominal - near) / (2 * np.pi)),
        )
        other = _find_other_postures(robot, near, nominal)

    def of(part: slice) -> Correction:
        return _find_chunk_targets(
            calibrated,
            position[part],
            rotation[part],
            wrench[part],
            nominal[part],
            left[part],
        )

    with ThreadPoolExecutor(2) as pool:
        done = [*pool.map(of, parts(len(position)))]
    found = Correction(
        *(
            np.concatenate([getattr(each, name) for each in done])
            for name in vars(done[0])
        )
    )
    found.status[other & (found.status != UNREACHABLE)] = OTHER_POSTURE
    return found


def _find_other_postures(
    robot: Robot, stated: np.ndarray, found: np.ndarray
) -> np.ndarray:
    """Which postures (N, n) are others than stated: far from them or, of six joints,
    behind a singular one; bool (N,)."""
    far = (
        np.abs(found - stated)
        > np.where(robot.chain.prismatic, reach_m(robot), 1.0) * _NEAR_RAD
    )
    if robot.joints != 6:
        return np.asarray(far.any(axis=1))
    scale = np.repeat([1.0 / reach_m(robot), 1.0], 3)[:, None]
    sides = [
        np.linalg.det(jacobians(robot.chain, each, robot.chain.end_effector) * scale)
        for each in (stated, found)
    ]
    sides = [
        np.where(np.abs(side) < _SINGULAR_DETERMINANT, 0.0, np.sign(side))
        for side in sides
    ]
    return np.asarray(far.any(axis=1) | (sides[0] * sides[1] < 0))


def large_steps(
    robot: Robot, position: np.ndarray, rotation: np.ndarray, joint_angles: np.ndarray
) -> list[tuple[int, int, float, float]]:
    """Steps from pose to pose that are larger than `allowed_steps`: row to which, joint
    (from 0), its step and what is allowed.

    `joint_angles` (N, n): commands, as the controller reports them.
    """
    steps = np.abs(np.diff(robot.model_angles(joint_angles), axis=0))
    allowed = allowed_steps(robot, position, rotation)
    return [
        (row + 1, joint, steps[row, joint], allowed[row, joint])
        for row, joint in np.argwhere(steps > allowed).tolist()
    ]


def _find_chunk_targets(
    calibrated: CalibratedRobot,
    position: np.ndarray,
    rotation: np.ndarray,
    wrench: np.ndarray,
    nominal: np.ndarray,
    left: np.ndarray,
) -> Correction:
    robot, joints = calibrated.robot, calibrated.robot.joints
    reached = left <= SOLVED_M
    scale = np.repeat([1.0, reach_m(robot)], 3)
    uncorrected = robot.reported_angles(nominal)
    coordinates, at, turned = come_to_rest(calibrated, uncorrected, wrench)
    added = regressed(calibrated, uncorrected, wrench)
    before = pose_differences(position, rotation, at + added, turned)
    inverse = np.linalg.pinv(jacobians(robot.chain, nominal, robot.chain.end_effector))
    angles = nominal.copy()
    off = before.copy()
    singular = np.zeros(len(angles), bool)
    # Rows that need another step: near singular postures more than elsewhere.
    moving = np.flatnonzero(reached)
    for number in range(_STEPS):
        step = (inverse[moving] @ off[moving, :, None])[..., 0]
        far = (
            np.abs(angles[moving] + step - nominal[moving]).max(axis=1)
            > _LARGEST_CORRECTION
        )
        singular[moving[far]] = True
        moving = moving[~far]
        step = step[~far]
        angles[moving] += step
        coordinates[moving, :joints] += step
        commands = robot.reported_angles(angles[moving])
        under = wrench[moving]
        coordinates[moving], at, turned = come_to_rest(
            calibrated, commands, under, coordinates[moving]
        )
        if number < _REGRESSED:
            added[moving] = regressed(calibrated, commands, under)
        off[moving] = pose_differences(
            position[moving], rotation[moving], at + added[moving], turned
        )
        moving = moving[np.linalg.norm(off[moving] * scale, axis=1) > _CORRECTED_M]
        if not len(moving):
            break
    singular[moving] = True
    status = np.full(len(angles), OK, dtype=f"U{len(OTHER_POSTURE)}")
    status[singular] = SINGULAR
    status[find_beyond_limits(robot, angles).any(axis=1)] = OUTSIDE_LIMITS
    status[~reached] = UNREACHABLE
    return Correction(robot.reported_angles(angles), uncorrected, before, off, status)
