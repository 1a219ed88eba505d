"""Regressors, covariances and condition numbers of the experiments, against pinocchio and dense linear algebra."""

import numpy as np
import pytest
from made_study_blocks import AT, OFFSET, experiments_of, joined, pinocchio_regressors
from support import OTHER_CHAINS, robot_of

from elastocal.mechanics.robot import with_target_offset
from elastocal.study.steps.columns import to_experiments
from elastocal.study.steps.design import Design, design_blocks


def test_design_table_names_the_right_set_length_and_joint_pair(kuka, strategies):
    table = joined(list(design_blocks(experiments_of(kuka), kuka.chain, strategies["6DoF"], 6, "end_effector")))
    assert table["data_set"].tolist() == np.repeat(range(5), 4).tolist()
    assert table["length"].tolist() == [1, 2, 3, 4] * 5
    # More configurations, less variance; never a condition number below one.
    for joint in range(1, 7):
        assert (np.diff(table[f"cov_{joint}_{joint}"].reshape(5, 4), axis=1) < 0).all()
    assert (table["condition"] >= 1).all()
    correlation = table["cov_2_1"] / np.sqrt(table["cov_1_1"] * table["cov_2_2"])
    assert (np.abs(correlation) <= 1 + 1e-9).all()


@pytest.mark.parametrize("rows", [3, 6])
@pytest.mark.parametrize("at", AT)
def test_regressors_are_those_of_equation_10_by_pinocchio(at, rows):
    robot = robot_of(OTHER_CHAINS["seven joints"])
    (block,) = experiments_of(robot, sets=2, configurations=3)
    design = Design(to_experiments(block), robot.chain, ("elbow", "flange"), rows, at)
    assert set(design.regressors) == set(design.torques) == {"elbow", "flange"}
    for name, found in design.regressors.items():
        assert found.shape == (rows, 7, 3, 2)
        expected = pinocchio_regressors(robot.chain, block, name, at, rows).reshape(2, 3, rows, 7)
        np.testing.assert_allclose(found, expected.transpose(2, 3, 1, 0), rtol=0, atol=1e-9)


def test_a_load_at_the_measuring_point_leaves_the_joints_behind_it_without_torque():
    robot = robot_of(OTHER_CHAINS["three joints"])
    (block,) = experiments_of(robot, sets=2, configurations=3)
    here, there = (
        Design(to_experiments(block), robot.chain, ("elbow",), 6, at).torques["elbow"]
        for at in ("measuring_point", "end_effector")
    )
    assert here.shape == (3, 2, 3)
    assert not here[..., 2].any() and (np.abs(there[..., 2]) > 1).all()


@pytest.mark.parametrize("rows", [3, 6])
def test_covariance_is_the_inverse_normal_matrix_and_condition_that_of_the_regressor(kuka, strategies, rows):
    moved = with_target_offset(kuka, OFFSET)
    (block,) = experiments_of(kuka, sets=3, configurations=4)
    (table,) = design_blocks([block], moved.chain, strategies["6DoF"], rows, "end_effector")
    regressors = pinocchio_regressors(moved.chain, block, "6DoF", rows=rows).reshape(3, 4, rows, 6)
    shortest = 6 // rows
    for row in np.flatnonzero(table["length"] > shortest):
        matrix = regressors[table["data_set"][row], : table["length"][row]].reshape(-1, 6)
        inverse = np.linalg.inv(matrix.T @ matrix)
        found = [table[f"cov_{max(i, j)}_{min(i, j)}"][row] for i in range(1, 7) for j in range(1, 7)]
        # Rounding grows with the square of the condition number, which is some hundreds here.
        np.testing.assert_allclose(found, inverse.ravel(), rtol=1e-6, atol=1e-6 * np.abs(inverse).max())
        assert table["condition"][row] == pytest.approx(np.linalg.cond(matrix), rel=1e-6)


def test_too_few_measurements_leave_covariance_and_condition_empty(kuka, strategies):
    moved = with_target_offset(kuka, OFFSET)
    (table,) = design_blocks(experiments_of(kuka, sets=3), moved.chain, strategies["6DoF"], 3, "end_effector")
    # One position is three measurements of six compliances.
    short = table["length"] == 1
    for name in ("cov_1_1", "cov_6_2", "condition"):
        assert np.isnan(table[name][short]).all() and np.isfinite(table[name][table["length"] >= 3]).all(), name
