"""Identification on the exact kinematics: Gauss-Newton steps on the pose at q + c J^T w, where equation 11 is linear.

Only an iterative solver gives a meaning to a strategy that "uses the estimate as initial condition".

Steps are whole ones, each by the normal equations of the problem linearised at the last estimate [1]; a rotation vector moves
by Bortz's equation, to first order in the vector [2].

[1] Björck, Å., Numerical Methods for Least Squares Problems, SIAM, 1996.
[2] Bortz, J. E., A new mathematical formulation for strapdown inertial navigation, IEEE Transactions on Aerospace and
    Electronic Systems AES-7, 1971.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from elastocal.mechanics.elastostatics import regressor
from elastocal.mechanics.kinematics import pose_differences, poses, poses_and_jacobians

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from elastocal.mechanics.chain import Chain, MeasuringPoint
    from elastocal.study.strategies import Strategy

STEPS = 30
# Relative size of the last step but one. Each step is about a thousand times smaller than the one before, down to the rounding
# of positions of metres against deflections of millimetres, which the condition number magnifies.
_LAST_STEP = 1e-7


def identify_exactly(
    strategy: Strategy,
    chain: Chain,
    joint_angles: np.ndarray,
    torques: Mapping[str, np.ndarray],
    deflections: Mapping[str, np.ndarray],
    start: np.ndarray,
    lengths: Sequence[int],
) -> np.ndarray:
    """Compliances by a strategy with the exact kinematics, for some prefix lengths of every data set.

    `joint_angles` (configurations, sets, n): rad. `torques` (configurations, sets, n): joint torques behind the measurements of
    each point, N m. `deflections` (configurations, sets, rows): measured deflection of each point, m and, where there are six
    rows, rad. `start` (n,): where joints start that no earlier stage has estimated, rad/(N m). `lengths`: prefix lengths to
    solve. Returns (lengths, n, sets): rad/(N m); not a number where the steps of a data set do not settle, as in very short
    prefixes near a singularity.
    """
    sets, joints = joint_angles.shape[1:]
    solved = np.empty((len(lengths), joints, sets))
    for index, length in enumerate(lengths):
        compliance = np.tile(start, (sets, 1))
        for stage in strategy.stages:
            data = [
                (chain.point(name), joint_angles[:length], torques[name][:length], deflections[name][:length])
                for name in stage.points
            ]
            compliance = _solve_stage(chain, data, list(stage.identified), compliance)
        solved[index] = compliance.T
    return solved


def _solve_stage(
    chain: Chain,
    data: Sequence[tuple[MeasuringPoint, np.ndarray, np.ndarray, np.ndarray]],
    identified: list[int],
    compliance: np.ndarray,
) -> np.ndarray:
    compliance = compliance.copy()
    started = [(*measurements, poses(chain, measurements[1], measurements[0])) for measurements in data]
    settled = np.zeros(len(compliance), bool)
    with np.errstate(all="ignore"):
        for _ in range(STEPS):
            normal: np.ndarray = np.zeros(())
            right: np.ndarray = np.zeros(())
            for point, joint_angles, torques, measured, unloaded in started:
                sensitivity, residual = _linearise(chain, point, joint_angles, torques, measured, unloaded, compliance)
                sensitivity = sensitivity[..., identified]
                normal = normal + np.einsum("ksri,ksrj->sij", sensitivity, sensitivity, optimize=True)
                right = right + np.einsum("ksri,ksr->si", sensitivity, residual, optimize=True)
            step = _solve(normal, right)
            compliance[:, identified] += step
            if settled.all():
                break
            settled = np.abs(step).max(axis=1) <= _LAST_STEP * np.abs(compliance).max(axis=1)
    compliance[~settled] = np.nan
    return compliance


def _solve(normal: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Solutions of the normal equations; not a number where they are singular."""
    usable = np.isfinite(normal).all(axis=(1, 2))
    usable[usable] = np.linalg.cond(normal[usable]) < 1.0 / np.finfo(float).eps
    solution = np.full_like(right, np.nan)
    solution[usable] = np.linalg.solve(normal[usable], right[usable, :, None])[..., 0]
    return solution


def _linearise(
    chain: Chain,
    point: MeasuringPoint,
    joint_angles: np.ndarray,
    torques: np.ndarray,
    measured: np.ndarray,
    unloaded: tuple[np.ndarray, np.ndarray],
    compliance: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Derivative of the predicted deflection with respect to the compliances, and what it leaves of the measured one."""
    rows = measured.shape[-1]
    position, rotation, jacobian = poses_and_jacobians(chain, joint_angles + compliance * torques, point)
    predicted = pose_differences(position, rotation, *unloaded)
    sensitivity = regressor(jacobian, torques)
    # A rotation vector r turns with angular velocity w at the rate w - r x w / 2 (first order in r).
    turn, angular = predicted[..., 3:, None], sensitivity[..., 3:, :]
    sensitivity[..., 3:, :] = angular - 0.5 * np.cross(turn, angular, axis=-2)
    return sensitivity[..., :rows, :], measured - predicted[..., :rows]
