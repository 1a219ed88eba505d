"""Equation 6: the Cartesian stiffness K_c of the loaded arm, w = K_c dt, and what it changes in deflections and compliances.

Under load the arm turns, and the torques of a given wrench with it. With K_G = d(J^T w)/dq the springs yield by
theta = (K_theta - K_G)^-1 J^T w instead of K_theta^-1 J^T w, so that K_c = (J (K_theta - K_G)^-1 J^T)^-1: Salisbury's stiffness
[1] with the term that makes it conservative [2].

[1] Salisbury, J. K., Active stiffness control of a manipulator in Cartesian coordinates, IEEE Conference on Decision and
    Control, 1980.
[2] Chen, S.-F. and Kao, I., Conservative congruence transformation for joint and Cartesian stiffness matrices of robotic hands
    and fingers, International Journal of Robotics Research 19, 2000.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from elastocal.mechanics.elastostatics import exact_deflections, joint_torques, loaded_point
from elastocal.mechanics.kinematics import jacobians
from elastocal.study.columns import real, table, whole
from elastocal.study.in_memory import ask
from elastocal.study.jobs import MICRO, below, tabulate

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import pandas as pd

    from elastocal.mechanics.chain import MeasuringPoint
    from elastocal.mechanics.robot import Robot
    from elastocal.study.in_memory import StudyInMemory

STIFFNESS = table(
    "stiffness",
    real("force", "N", "magnitude of the load"),
    real("softest", "N/m", "least translational stiffness, median over test configurations"),
    real("first_order", "percent", "distance of the first order from the exact kinematics over the displacement"),
    real("loaded", "percent", "distance of the exact kinematics from the equilibrium of the loaded arm"),
    real("by_k_c", "percent", "distance of equation 6 from equation 8 over the displacement"),
    real("bias", "percent", "largest relative bias of a compliance by equation 11 from arms in equilibrium"),
    real("k_sigma", "percent", "sum over joints of the relative bias of the stiffness"),
    whole("offset_rank", "joints that one data set identifies without the offset of the force"),
    whole("rank", "the same with the offset"),
)
# Turns of a loaded arm are milliradians, so that each pass leaves a thousandth of the error of the one before.
_PASSES = 6


def torque_gradient(jacobian: np.ndarray, wrench: np.ndarray) -> np.ndarray:
    """K_G: derivatives of the torques J^T w by the joint angles, in closed form for a serial chain.

    `jacobian` (..., 6, n): of the point where the wrench acts. `wrench` (..., 6): fixed in base axes. Returns (..., n, n): row
    for the torque, column for the angle; N m.
    """
    linear, angular = jacobian[..., :3, :], jacobian[..., 3:, :]
    row, column = np.indices(2 * jacobian.shape[-1:])
    moved = np.cross(angular[..., np.minimum(row, column)], linear[..., np.maximum(row, column)], axis=-3)
    # A joint turns the axes of those behind it, not of those before.
    turned = np.where(column < row, np.cross(angular[..., column], angular[..., row], axis=-3), 0.0)
    return np.einsum("...kij,...k->...ij", np.concatenate([moved, turned], axis=-3), wrench)


def loaded_compliance(jacobian: np.ndarray, compliance: np.ndarray, gradient: np.ndarray) -> np.ndarray:
    """Inverse of K_c: deflection per wrench, (..., 6, 6); `gradient` (..., n, n): from `torque_gradient`."""
    springs = np.linalg.inv(np.diag(1.0 / compliance) - gradient)
    return jacobian @ springs @ np.swapaxes(jacobian, -1, -2)


def equilibrium(robot: Robot, joint_angles: np.ndarray, wrench: np.ndarray, at: MeasuringPoint) -> np.ndarray:
    """How far the joints yield where torques are those of the loaded arm: theta = C J(q + theta)^T w by fixed-point iteration.

    `joint_angles` (..., n): unloaded, rad. `wrench` (..., 6) at the point `at`. Returns (..., n): rad.
    """
    theta = np.zeros_like(joint_angles)
    for _ in range(_PASSES):
        theta = robot.compliance * joint_torques(robot.chain, joint_angles + theta, wrench, at)
    return theta


def stiffness_columns(study: StudyInMemory, forces_N: Sequence[float]) -> dict[str, np.ndarray]:
    """What K_c changes, for each load: on test configurations, and in compliances from data sets without noise."""
    rows = [_at_load(study.under(force_N=force)) for force in forces_N]
    return {"force": np.array(forces_N)} | {name: np.array([row[name] for row in rows]) for name in rows[0]}


def _at_load(study: StudyInMemory) -> dict[str, float]:
    robot, tests, drawn = study.robot, study.tests(), study.experiments(np.arange(study.size.data_sets))
    chain, end = robot.chain, robot.chain.end_effector
    at = loaded_point(chain, end, study.interpretation.wrench_at)
    jacobian = jacobians(chain, tests.joint_angles, at)
    plain = robot.compliance * joint_torques(chain, tests.joint_angles, tests.wrench, at)
    settled = equilibrium(robot, tests.joint_angles, tests.wrench, at)
    inverse = loaded_compliance(jacobian, robot.compliance, torque_gradient(jacobian, tests.wrench))
    first = (jacobians(chain, tests.joint_angles, end) @ plain[..., None])[..., :3, 0]
    second = (inverse @ tests.wrench[..., None])[..., :3, 0]
    exact, there = (exact_deflections(chain, tests.joint_angles, by, end)[..., :3] for by in (plain, settled))
    size = np.linalg.norm(there, axis=-1).mean()
    apart = {"first_order": first - exact, "loaded": exact - there, "by_k_c": second - first}
    theta = equilibrium(robot, drawn.joint_angles, drawn.wrench, at)
    deflection = exact_deflections(chain, drawn.joint_angles, theta, end)
    relative = _least_squares(study.regressor(drawn), deflection) / robot.compliance
    without = study.under(offset_m=(0, 0, 0))
    offset_rank, rank = (
        np.linalg.matrix_rank((one.regressor(one.experiments([0]))[0] * robot.compliance).reshape(-1, robot.joints), 1e-9)
        for one in (without, study)
    )
    return {
        "softest": np.median(1.0 / np.linalg.eigvals(inverse[..., :3, :3]).real.max(axis=-1)),
        **{name: 100 * np.linalg.norm(gap, axis=-1).mean() / size for name, gap in apart.items()},
        "bias": 100 * np.abs(relative.mean(axis=0) - 1).max(),
        "k_sigma": 100 * ((1 / relative).mean(axis=0) - 1).sum(),
        "offset_rank": offset_rank,
        "rank": rank,
    }


def _least_squares(regressor: np.ndarray, deflection: np.ndarray) -> np.ndarray:
    """Compliances (sets, n) of each data set by equation 11."""
    rows = regressor.reshape(len(regressor), -1, regressor.shape[-1])
    across = rows.swapaxes(1, 2)
    return np.linalg.solve(across @ rows, across @ deflection.reshape(len(rows), -1, 1))[..., 0]


def stiffness_table(found: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    """Of all robots: robot, force_N, softest_N_per_um, the shares in percent, offset_rank, rank."""
    frame = below(found)
    part = frame[["robot"]].assign(force_N=frame.force, softest_N_per_um=frame.softest / MICRO)
    part = part.join(frame[["first_order", "loaded", "by_k_c", "bias", "k_sigma"]].add_suffix("_percent"))
    return part.join(frame[["offset_rank", "rank"]])


load_arm = ask(STIFFNESS, stiffness_columns)
tabulate_stiffness = tabulate(STIFFNESS, stiffness_table)
