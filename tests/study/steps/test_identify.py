"""Compliances of one strategy for every prefix of every data set."""

import numpy as np
import pytest
from made_study_blocks import (
    AT,
    OFFSET,
    compliances,
    deflections_of,
    experiments_of,
    identified,
    pinocchio_regressors,
)

from elastocal.mechanics.robot import with_target_offset
from elastocal.study.steps.columns import to_deflections


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
        np.testing.assert_array_equal(np.isnan(table[f"c{joint}"]), empty)
