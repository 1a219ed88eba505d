"""Angles from Gram matrices: those of scipy between the columns themselves."""

from dataclasses import replace

import numpy as np
import pytest
from made_problems import made_problem, made_rows, made_unit
from scipy.linalg import subspace_angles

from elastocal.diagnosis.confounding import angles_between, nearest_angles

UNITS = tuple(made_unit(name, (), columns) for name, columns in zip("abcd", ([0, 1], 2, [3, 4], 5), strict=True))


@pytest.fixture(scope="module")
def problem():
    """Four units, one of which is nearly in the span of another, and what they are beyond the declared model."""
    rows = made_rows(1, poses=10)
    candidates = rows.candidates.copy()
    candidates[:, 2] = candidates[:, 0] - 2 * candidates[:, 1] + 0.01 * candidates[:, 2] + 5 * rows.declared[:, 0]
    rows = replace(rows, candidates=candidates, prior_std=np.full(4, 1e6))
    beyond = candidates - rows.declared @ np.linalg.lstsq(rows.declared, candidates)[0]
    return made_problem(rows, UNITS)[0], beyond


def expected(beyond, one, other):
    return np.degrees(subspace_angles(beyond[:, UNITS[one].columns], beyond[:, UNITS[other].columns]).min())


def test_angles_are_the_smallest_principal_ones(problem):
    problem, beyond = problem
    found = angles_between(problem, [0, 1, 2, 3])
    np.testing.assert_allclose(found, found.T, atol=1e-5)
    for one in range(4):
        for other in range(one + 1):
            assert found[one, other] == pytest.approx(expected(beyond, one, other), abs=1e-4), (one, other)
    assert found[0, 1] < 1.0


def test_nearest_angle_is_that_to_the_nearest_found_unit(problem):
    problem, _ = problem
    every = angles_between(problem, [0, 1, 2, 3])
    np.testing.assert_allclose(nearest_angles(problem, [1, 2]), every[:, [1, 2]].min(axis=1), atol=1e-5)
    assert np.isnan(nearest_angles(problem, [])).all()


def test_a_unit_without_columns_beyond_the_declared_model_is_at_right_angles(problem):
    """Rounding of what the declared model takes is no direction."""
    problem, _ = problem
    statistics = problem.statistics
    gram = statistics.gram.copy()
    gram[:, 5], gram[:, :, 5] = 0.0, 0.0
    problem = replace(problem, statistics=replace(statistics, gram=gram))
    assert nearest_angles(problem, [0])[3] == 90.0 and angles_between(problem, [0, 3])[0, 1] == 90.0
