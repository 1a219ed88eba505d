"""Equation 11 beside Gauss-Newton: both from the same measurements, one strategy after the other."""

import numpy as np
import pytest
from made_studies import few_of
from made_study_blocks import deflections_of, experiments_of, pinocchio_regressors

from elastocal.study.identify import paired_blocks
from elastocal.study.simulation import to_deflections
from elastocal.study.solvers import solver_blocks, start_columns


def solve(robot, experiments, deflections, strategies, length, rows=6):
    return list(
        solver_blocks(paired_blocks(experiments, deflections), robot.chain, strategies, rows, "end_effector", length, 1e-6)
    )


def estimates(columns, solver):
    return np.column_stack([columns[f"{solver}_c{j}"] for j in range(1, 7)])


def test_gauss_newton_finds_the_compliances_of_exact_data_and_equation_11_those_of_numpy_least_squares(kuka, strategies):
    experiments = experiments_of(kuka, sets=3)
    deflections = deflections_of(kuka, experiments)
    (found,) = solve(kuka, experiments, {"6DoF": deflections["6DoF"]}, [strategies["6DoF"]], 3)
    np.testing.assert_allclose(estimates(found, "gauss_newton"), np.tile(kuka.compliance, (3, 1)), rtol=1e-8)
    regressors = pinocchio_regressors(kuka.chain, experiments[0], "6DoF").reshape(3, 4, 6, 6)[:, :3].reshape(3, 18, 6)
    seen = to_deflections(deflections["6DoF"][0])[:, :3].reshape(3, 18)
    expected = [np.linalg.lstsq(matrix, right, rcond=None)[0] for matrix, right in zip(regressors, seen, strict=True)]
    np.testing.assert_allclose(estimates(found, "equation_11"), expected, rtol=1e-8)


def test_a_stage_that_identifies_every_joint_leaves_equation_11_nothing_of_those_before_it(kuka, strategies):
    experiments = experiments_of(kuka, sets=2)
    deflections = {name: deflections_of(kuka, experiments, noise=1e-4)[name] for name in ("3DoF", "6DoF")}
    alone, after = solve(kuka, experiments, deflections, [strategies["6DoF"], strategies["6DoF-after-3DoF"]], 4)
    for solver in ("equation_11", "gauss_newton"):
        np.testing.assert_allclose(estimates(after, solver), estimates(alone, solver), rtol=1e-7)


@pytest.mark.parametrize("share", [0.1, 0.01])
def test_the_solvers_differ_in_proportion_to_the_deflection(kuka, strategies, share):
    """What equation 11 leaves out is of second order in the turns of the joints."""
    differences = []
    for scale in (1.0, share):
        (block,) = experiments_of(kuka, sets=2)
        block = block | {name: scale * block[name] for name in ("fx", "fy", "fz", "mx", "my", "mz")}
        deflections = deflections_of(kuka, [block])
        (found,) = solve(kuka, [block], {"6DoF": deflections["6DoF"]}, [strategies["6DoF"]], 4)
        differences.append(np.abs(estimates(found, "equation_11") / estimates(found, "gauss_newton") - 1).max())
    assert differences[0] > 1e-5
    assert differences[1] / differences[0] == pytest.approx(share, rel=0.1)


def test_a_start_from_which_steps_do_not_settle_is_counted(kuka, strategies):
    # Springs so soft that the first step turns joints by radians.
    found = start_columns(few_of(kuka), [strategies["6DoF"]], [1e-6, 1.0])
    assert found["unsettled"][1] > 0 or np.nanmax(found["difference"]) > 1e-3
