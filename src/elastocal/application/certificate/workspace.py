"""Position errors over the workspace: what an uncorrected robot misses, and a bound of what a corrected one misses."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.stats import gamma

from elastocal.application.calibrated import OperatingConditions, forward, nominal_forward, prediction_covariance
from elastocal.campaigns.joint_space import beyond_range
from elastocal.mechanics.kinematics import jacobians

if TYPE_CHECKING:
    from elastocal.application.calibrated import CalibratedRobot

_CONFIDENCE = 0.95


@dataclass(frozen=True)
class WorkspaceErrors:
    """Errors at poses drawn over the workspace.

    Attributes
    ----------
    joint_angles : ndarray (N, n)
        As the controller reports them, rad.
    position : ndarray (N, 3)
        m, base axes.
    uncorrected_m : ndarray (N,)
        Distance of the robot from where its file has it.
    bound_m : ndarray (N,)
        Below which the corrected robot misses 95 % of the time, repeatability included.
    outside : ndarray of bool (N,)
        Beyond the range of the fitted poses.
    """

    joint_angles: np.ndarray
    position: np.ndarray
    uncorrected_m: np.ndarray
    bound_m: np.ndarray
    outside: np.ndarray


def drawn_angles(calibrated: CalibratedRobot, count: int, stream: np.random.Generator) -> np.ndarray:
    """Joint angles evenly over the limits, as the controller reports them, rad, ndarray (N, n)."""
    low, high = calibrated.robot.joint_limits.T
    return calibrated.robot.reported_angles(stream.uniform(low, high, (count, len(low))))


def workspace_errors(
    calibrated: CalibratedRobot, reported_angles: np.ndarray, wrench: np.ndarray, fitted_angles: np.ndarray, factor: float
) -> WorkspaceErrors:
    """Errors at some poses under one load.

    The bound is the 95 % quantile of the length of a normal vector, by the gamma distribution that has its first two moments
    (Satterthwaite [1]_, for sums of squares of unequal variance), times a factor that held-out poses give.

    Parameters
    ----------
    calibrated : CalibratedRobot
    reported_angles : ndarray (N, n)
        rad.
    wrench : ndarray (6,)
        N, N m, at the last measuring point, base axes.
    fitted_angles : ndarray (P, n)
        Of the campaign, of the chain, rad.
    factor : float
        From `calibration_factor`.

    Returns
    -------
    WorkspaceErrors

    References
    ----------
    .. [1] Satterthwaite, F. E., An approximate distribution of estimates of variance components, Biometrics Bulletin 2, 1946.
    """
    operating = OperatingConditions(np.asarray(wrench, float)[None])
    position, _ = forward(calibrated, reported_angles, operating)
    angles = calibrated.robot.model_angles(reported_angles)
    nominal, _ = nominal_forward(calibrated.robot, reported_angles)
    return WorkspaceErrors(
        reported_angles,
        position,
        np.linalg.norm(position - nominal, axis=1),
        factor * quantile_of_length(position_covariance(calibrated, reported_angles, operating)),
        beyond_range(fitted_angles, angles),
    )


def position_covariance(calibrated: CalibratedRobot, reported_angles: np.ndarray, operating: OperatingConditions) -> np.ndarray:
    """Covariance of what a corrected robot misses, ndarray (N, 3, 3), m²: uncertainty of the parameters and repeatability."""
    robot = calibrated.robot
    of_parameters = prediction_covariance(calibrated, reported_angles, operating)[:, :3, :3]
    jacobian = jacobians(robot.chain, robot.model_angles(reported_angles), robot.chain.end_effector)[:, :3]
    spread = jacobian * calibrated.noise.joint_rad
    return of_parameters + spread @ spread.transpose(0, 2, 1)


def calibration_factor(distance: np.ndarray, covariance: np.ndarray, sensor_m: float) -> float:
    """By how much held-out poses are missed more than predicted: ratio of root mean squares, 1 where they are not.

    Parameters
    ----------
    distance : ndarray (M,)
        Measured on held-out poses, m.
    covariance : ndarray (M, 3, 3)
        Predicted for them, m².
    sensor_m : float
        Standard deviation of the sensor in one coordinate.

    Returns
    -------
    float
    """
    predicted = np.trace(covariance, axis1=1, axis2=2).mean()
    measured = max(float((distance**2).mean()) - 3.0 * sensor_m**2, 0.0)
    return max(1.0, float(np.sqrt(measured / predicted))) if predicted > 0.0 else 1.0


def quantile_of_length(covariance: np.ndarray) -> np.ndarray:
    """95 % quantile of the length of normal vectors of some covariances (N, 3, 3), ndarray (N,)."""
    mean = np.trace(covariance, axis1=1, axis2=2)
    variance = 2.0 * (covariance**2).sum(axis=(1, 2))
    safe = np.where(mean > 0.0, mean, 1.0)
    shape = np.where(mean > 0.0, safe**2 / np.where(variance > 0.0, variance, 1.0), 1.5)
    return np.sqrt(gamma.ppf(_CONFIDENCE, shape) * mean / shape)
