"""Identification on the exact kinematics: Gauss-Newton steps on the pose at q + c J^T w, where equation 11 is linear.

Only an iterative solver gives a meaning to a strategy that "uses the estimate as initial condition".
"""

import numpy as np

from elastocal.elastostatics import exact_deflections, regressor
from elastocal.kinematics import poses_and_jacobians

STEPS = 30
# Relative size of the last step. Rounding of positions of metres against deflections of millimetres allows steps of 1e-12; each
# step is about a thousand times smaller than the one before, so what follows the last one is lost in it.
LAST_STEP = 1e-10


def identify_exactly(strategy, chain, joint_angles, torques, deflections, start, lengths):
    """Compliances by a strategy with the exact kinematics, for some prefix lengths of every data set.

    Parameters
    ----------
    strategy : Strategy
    chain : Chain
    joint_angles : ndarray (configurations, sets, n)
        rad.
    torques : dict of str to ndarray (configurations, sets, n)
        Joint torques behind the readings of each point, N m.
    deflections : dict of str to ndarray (configurations, sets, rows)
        Measured deflection of each point, m and, where there are six rows, rad.
    start : ndarray (n,)
        Where joints start that no earlier stage has estimated, rad/(N m).
    lengths : sequence of int
        Prefix lengths to solve.

    Returns
    -------
    ndarray (lengths, n, sets)
        rad/(N m).

    Raises
    ------
    ArithmeticError
        Where the steps do not settle.
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


def _solve_stage(chain, data, identified, compliance):
    compliance = compliance.copy()
    for _ in range(STEPS):
        normal = right = 0.0
        for point, joint_angles, torques, measured in data:
            sensitivity, residual = _linearised(chain, point, joint_angles, torques, measured, compliance)
            sensitivity = sensitivity[..., identified]
            normal = normal + np.einsum("ksri,ksrj->sij", sensitivity, sensitivity, optimize=True)
            right = right + np.einsum("ksri,ksr->si", sensitivity, residual, optimize=True)
        step = np.linalg.solve(normal, right[..., None])[..., 0]
        compliance[:, identified] += step
        if np.abs(step).max() <= LAST_STEP * np.abs(compliance).max():
            return compliance
    raise ArithmeticError(f"Gauss-Newton did not settle within {STEPS} steps")


def _linearised(chain, point, joint_angles, torques, measured, compliance):
    """Derivative of the predicted deflection with respect to the compliances, and what it leaves of the measured one."""
    rows = measured.shape[-1]
    springs = compliance * torques
    predicted = exact_deflections(chain, joint_angles, springs, point)
    sensitivity = regressor(poses_and_jacobians(chain, joint_angles + springs, point)[2], torques)
    # A rotation vector r turns with angular velocity w at the rate w - r x w / 2 (first order in r).
    turn, angular = predicted[..., 3:, None], sensitivity[..., 3:, :]
    sensitivity[..., 3:, :] = angular - 0.5 * np.cross(turn, angular, axis=-2)
    return sensitivity[..., :rows, :], measured - predicted[..., :rows]
