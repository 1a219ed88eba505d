"""What some claims of the paper need beside its tables: equation 6, and where an iterative solver starts."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from elastocal.mechanics.elastostatics import exact_deflections, joint_torques, loaded_point
from elastocal.mechanics.kinematics import jacobians
from elastocal.study.cartesian_stiffness import equilibrium, loaded_compliance, torque_gradient
from elastocal.study.gauss_newton import identify_exactly
from elastocal.study.steps.design import Design, configuration_first

if TYPE_CHECKING:
    from collections.abc import Sequence

    from elastocal.study.steps.in_memory import StudyInMemory
    from elastocal.study.strategies import Strategy


def stiffness_columns(study: StudyInMemory, forces_N: Sequence[float]) -> dict[str, np.ndarray]:
    """What K_c changes, for each load: on test configurations, and in compliances from data sets without noise.

    `study`: with as many configurations as identify. Returns one row for each force: softest: median over the test
    configurations of the least translational stiffness (N/m); first_order, loaded: mean distance of the displacement by the
    first order (equation 8) from that of the exact kinematics, and of the latter from the equilibrium of the loaded arm, over
    the mean displacement (percent); by_k_c: the same of equation 6 from equation 8; bias: largest relative bias of a compliance
    by equation 11 from displacements in equilibrium (percent); k_sigma: sum over stiffnesses of the same; offset_rank and rank:
    joints that a data set identifies without the offset of the force and with it.
    """
    robot = study.robot
    chain, end = robot.chain, robot.chain.end_effector
    at, rows = loaded_point(chain, end, study.interpretation.wrench_at), []
    for force in forces_N:
        loaded = study.under(force_N=force)
        tests = loaded.tests()
        jacobian = jacobians(chain, tests.joint_angles, at)
        plain = robot.compliance * joint_torques(chain, tests.joint_angles, tests.wrench, at)
        settled = equilibrium(robot, tests.joint_angles, tests.wrench, at)
        inverse = loaded_compliance(jacobian, robot.compliance, torque_gradient(jacobian, tests.wrench))
        first = (jacobians(chain, tests.joint_angles, end) @ plain[..., None])[..., :3, 0]
        second = (inverse @ tests.wrench[..., None])[..., :3, 0]
        exact, there = (exact_deflections(chain, tests.joint_angles, by, end)[..., :3] for by in (plain, settled))
        size = np.linalg.norm(there, axis=-1).mean()
        apart = {"first_order": first - exact, "loaded": exact - there, "by_k_c": second - first}
        drawn = loaded.experiments(np.arange(study.size.data_sets))
        theta = equilibrium(robot, drawn.joint_angles, drawn.wrench, at)
        deflection = exact_deflections(chain, drawn.joint_angles, theta, end)
        found = _least_squares(loaded.regressor(drawn), deflection)
        relative = found / robot.compliance
        ranks = [
            np.linalg.matrix_rank((one.regressor(one.experiments([0]))[0] * robot.compliance).reshape(-1, robot.joints), 1e-9)
            for one in (loaded.under(offset_m=(0, 0, 0)), loaded)
        ]
        rows.append(
            {
                "force": force,
                "softest": np.median(1.0 / np.linalg.eigvals(inverse[..., :3, :3]).real.max(axis=-1)),
                **{name: 100 * np.linalg.norm(gap, axis=-1).mean() / size for name, gap in apart.items()},
                "bias": 100 * np.abs(relative.mean(axis=0) - 1).max(),
                "k_sigma": 100 * ((1 / relative).mean(axis=0) - 1).sum(),
                "offset_rank": ranks[0],
                "rank": ranks[1],
            }
        )
    return {name: np.array([row[name] for row in rows]) for name in rows[0]}


def start_columns(study: StudyInMemory, strategy: Strategy, starts: Sequence[float]) -> dict[str, np.ndarray]:
    """Whether Gauss-Newton comes to the same estimates from every start.

    `starts`: rad/(N m), the same for all joints. Returns one row for each start: difference: largest relative difference of a
    compliance from that of the first start; unsettled: share of data sets whose steps do not settle.
    """
    sets, rows = np.arange(study.size.data_sets), study.interpretation.rows
    drawn, chain = study.experiments(sets), study.robot.chain
    design = Design(drawn, chain, strategy.points, rows, study.interpretation.wrench_at)
    measured = {
        name: configuration_first(study.deflections(drawn, name) + study.size.noise * study.noise(sets, name))[..., :rows]
        for name in strategy.points
    }
    found = [
        identify_exactly(
            strategy,
            chain,
            design.joint_angles,
            design.torques,
            measured,
            np.full(chain.coordinates, start),
            [study.size.configurations],
        )[0]
        for start in starts
    ]
    return {
        "start": np.array(starts),
        "difference": np.array([np.nanmax(np.abs(each / found[0] - 1)) for each in found]),
        "unsettled": np.array([np.isnan(each).any(axis=0).mean() for each in found]),
    }


def _least_squares(regressor: np.ndarray, deflection: np.ndarray) -> np.ndarray:
    """Compliances (sets, n) of each data set by equation 11."""
    rows = regressor.reshape(len(regressor), -1, regressor.shape[-1])
    across = rows.swapaxes(1, 2)
    return np.linalg.solve(across @ rows, across @ deflection.reshape(len(rows), -1, 1))[..., 0]
