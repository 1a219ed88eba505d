"""Position errors over the workspace: what an uncorrected robot misses, and a bound of what a corrected one misses."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from elastocal.application.accuracy import before_m, predict_errors
from elastocal.application.calibrated import OperatingConditions, forward, nominal_forward
from elastocal.campaigns.joint_space import beyond_range
from elastocal.mechanics.pose_differences import pose_differences

if TYPE_CHECKING:
    from elastocal.application.calibrated import CalibratedRobot


@dataclass(frozen=True)
class WorkspaceErrors:
    """Errors at poses drawn over the workspace.

    `joint_angles` (N, n): as the controller reports them, rad. `position` (N, 3): m, base axes. `uncorrected_m` (N,): distance
    of the robot from where its file has it, less what the placement of its base takes up. `corrected_m` (N,): RMS error that is
    predicted of the corrected robot. `bound_m` (N,): below which that one misses 95 % of the time, all told. `outside` (N,) of
    bool: beyond the range of the fitted poses.
    """

    joint_angles: np.ndarray
    position: np.ndarray
    uncorrected_m: np.ndarray
    corrected_m: np.ndarray
    bound_m: np.ndarray
    outside: np.ndarray


def draw_angles(calibrated: CalibratedRobot, count: int, stream: np.random.Generator) -> np.ndarray:
    """Joint angles evenly over the limits, as the controller reports them, rad, ndarray (N, n)."""
    low, high = calibrated.robot.joint_limits.T
    return calibrated.robot.reported_angles(stream.uniform(low, high, (count, len(low))))


def workspace_errors(
    calibrated: CalibratedRobot, reported_angles: np.ndarray, wrench: np.ndarray, fitted_angles: np.ndarray
) -> WorkspaceErrors:
    """Errors at some poses under one load.

    What a corrected robot misses is what `accuracy.predict_errors` says of these poses.

    `reported_angles` (N, n): rad. `wrench` (6,): N, N m, at the last measuring point, base axes. `fitted_angles` (P, n): of the
    campaign, of the chain, rad.
    """
    operating = OperatingConditions(np.asarray(wrench, float)[None])
    position, rotation = forward(calibrated, reported_angles, operating)
    off = pose_differences(*nominal_forward(calibrated.robot, reported_angles), position, rotation)
    after = predict_errors(calibrated, reported_angles, operating, draws=0)
    return WorkspaceErrors(
        reported_angles,
        position,
        before_m(calibrated, position, rotation, off),
        after.error_m,
        after.bound_m,
        beyond_range(fitted_angles, calibrated.robot.model_angles(reported_angles)),
    )
