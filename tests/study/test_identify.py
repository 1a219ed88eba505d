"""Compliances of one strategy for every prefix of every data set."""

import numpy as np
import pytest
from made_study_blocks import AT, OFFSET, compliances, deflections_of, experiments_of, identified, joined, pinocchio_regressors
from support import OTHER_CHAINS, robot_of

from elastocal.mechanics.robot import with_target_offset
from elastocal.study.identify import Design, design_blocks
from elastocal.study.simulation import to_deflections, to_experiments


@pytest.mark.parametrize("at", AT)
@pytest.mark.parametrize("name", ["3+6DoF-comb", "4-6DoF-after-3DoF", "5-6DoF-after-4DoF"])
def test_exact_data_give_the_true_compliances(robot, strategies, name, at):
    experiments = experiments_of(robot)
    deflections = deflections_of(robot, experiments, at=at)
    for start, relative in ((None, 0.05), (1e-6, 1e-8)):
        table = identified(robot, strategies[name], experiments, deflections, at=at, start=start)
        found = compliances(table, 4)
        assert found.shape == (5, 6)
        np.testing.assert_allclose(found, np.tile(robot.compliance, (5, 1)), rtol=relative)


@pytest.mark.parametrize(
    ("name", "rows", "at"),
    [
        *(("6DoF", rows, at) for rows in (3, 6) for at in AT),
        # One position of the end-effector has measurements enough for joints 4-6, but they meet in one point.
        *((name, 3, "measuring_point") for name in ("3+6DoF-comb", "4-6DoF-after-3DoF", "5-6DoF-after-4DoF")),
    ],
)
def test_exact_data_of_a_target_off_the_flange_give_the_true_compliances(kuka, strategies, name, rows, at):
    # Interpretations R5 and R6 together: under "end_effector" the wrench stays where it is stated, whatever target is measured.
    moved, experiments = with_target_offset(kuka, OFFSET), experiments_of(kuka)
    deflections = deflections_of(moved, experiments, at=at)
    table = identified(moved, strategies[name], experiments, deflections, rows, at, start=1e-6)
    tolerance = 1e-7 if name == "6DoF" else 1e-6
    np.testing.assert_allclose(compliances(table, 4), np.tile(kuka.compliance, (5, 1)), rtol=tolerance)


@pytest.mark.parametrize("rows", [3, 6])
def test_estimates_of_every_prefix_are_numpy_least_squares_of_its_measurements(kuka, strategies, rows):
    moved, experiments = with_target_offset(kuka, OFFSET), experiments_of(kuka, sets=3)
    deflections = deflections_of(moved, experiments, noise=2e-4)
    table = identified(moved, strategies["3+6DoF-comb"], experiments, deflections, rows)
    regressors = {name: pinocchio_regressors(moved.chain, experiments[0], name, rows=rows) for name in ("3DoF", "6DoF")}
    matrices = {name: matrix.reshape(3, 4, rows, 6) for name, matrix in regressors.items()}
    measured = {name: to_deflections(deflections[name][0])[..., :rows] for name in matrices}
    for length in (3, 4):
        for number, found in enumerate(compliances(table, length)):
            matrix = np.concatenate([matrices[name][number, :length].reshape(-1, 6) for name in matrices])
            seen = np.concatenate([measured[name][number, :length].ravel() for name in matrices])
            np.testing.assert_allclose(found, np.linalg.lstsq(matrix, seen, rcond=None)[0], rtol=1e-7)


@pytest.mark.parametrize("start", [None, 1e-6])
def test_nothing_is_identified_before_anything_loads_the_robot_and_everything_after(kuka, strategies, start):
    (experiments,) = experiments_of(kuka, sets=2)
    # No load in the first configuration of one data set and the first two of the other.
    empty = np.array([True, False, False, False, True, True, False, False])
    for name in ("fx", "fy", "fz", "mx", "my", "mz"):
        experiments[name] = np.where(empty, 0.0, experiments[name])
    table = identified(kuka, strategies["6DoF"], [experiments], deflections_of(kuka, [experiments]), start=start)
    for joint in range(1, 7):
        np.testing.assert_array_equal(np.isnan(table[f"compliance_{joint}"]), empty)


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
