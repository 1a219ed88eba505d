"""Equation 11 for every prefix, against a plain loop of numpy.linalg.lstsq and against explicit matrices."""

from functools import cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support import random_loads, without_tool

from elastocal.mechanics.elastostatics import joint_torques, regressor
from elastocal.mechanics.kinematics import poses_and_jacobians
from elastocal.mechanics.robot import with_target_offset
from elastocal.study.equation_11 import (
    Measurements,
    Prior,
    condition_numbers,
    estimate_compliance,
    first_solvable_length,
    identify,
    prefix_triangles,
    undetermined,
)
from elastocal.study.simulation import true_deflections
from elastocal.study.strategies import Stage, Strategy

SETS, CONFIGURATIONS = 3, 5
NAMES = [
    "6DoF",
    "6DoF-after-3DoF",
    "4-6DoF-after-3DoF",
    "6DoF-after-3+3DoF",
    "3+6DoF-comb",
    "4-6DoF-after-6+3DoF",
    "3-6DoF-after-2DoF",
    "5-6DoF-after-4DoF",
]
# Not the paper's, but allowed: a later stage that holds nothing need not make the earlier ones superfluous.
REFINED = Strategy("3DoF after 6DoF", (Stage(("6DoF",), tuple(range(6))), Stage(("3DoF",), (0, 1, 2))))
RESUMED = Strategy(
    "2DoF again after 3DoF",
    (
        Stage(("2DoF",), (0, 1)),
        Stage(("3DoF",), (2,), (0, 1)),
        Stage(("2DoF",), (0, 1)),
        Stage(("6DoF",), (3, 4, 5), (0, 1, 2)),
    ),
)
SHUFFLED = Strategy("6DoF, joints in any order", (Stage(("6DoF",), (4, 0, 5, 2, 1, 3)),))
SEVEN = Strategy("seven", (Stage(("A",), (0, 1)), Stage(("A",), (0, 1, 2, 3, 4, 5, 6))))
BY_POSITIONS = ("6DoF", "3+6DoF-comb", "4-6DoF-after-3DoF", "4-6DoF-after-6+3DoF")
UNUSUAL = {"refined": REFINED, "resumed": RESUMED, "shuffled": SHUFFLED}


class Data:
    """Regressors (sets, configurations, rows, n) and measured deflections (sets, configurations, rows) of each point."""

    def __init__(self, robot, rows):
        rng = np.random.default_rng(0)
        loads = random_loads(robot, SETS, CONFIGURATIONS)
        torques = joint_torques(robot.chain, loads.joint_angles, loads.wrench, without_tool(robot.chain.end_effector))
        self.matrix, self.measured = {}, {}
        for point in robot.chain.points:
            jacobian = poses_and_jacobians(robot.chain, loads.joint_angles, point)[2]
            self.matrix[point.name] = regressor(jacobian, torques)[..., :rows, :]
            deflection = true_deflections(robot, loads, point, "end_effector")[..., :rows]
            self.measured[point.name] = deflection + 2e-4 * rng.standard_normal(deflection.shape)

    def measurements(self):
        return {name: Measurements(self.matrix[name].transpose(2, 3, 1, 0), self.measured[name].T) for name in self.matrix}


@cache
def data_of(robot_key, rows, load):
    robot = load(robot_key)
    return Data(with_target_offset(robot, (0.1, 0.05, 0.2)) if rows == 3 else robot, rows)


@pytest.fixture(params=["kuka", "fanuc"])
def data(request, robots):
    return data_of(request.param, 6, robots)


@pytest.fixture
def robots(kuka, fanuc):
    return {"kuka": kuka, "fanuc": fanuc}.__getitem__


def plain(strategy, matrix, measured, joints=6):
    """One data set, one prefix: the stages one after the other by numpy.linalg.lstsq; (configurations, rows, ...) per point."""
    compliance = np.full(joints, np.nan)
    for stage in strategy.stages:
        rows = np.concatenate([matrix[name].reshape(-1, joints) for name in stage.points])
        right = np.concatenate([measured[name].ravel() for name in stage.points])
        fixed, identified = list(stage.fixed), list(stage.identified)
        right = right - rows[:, fixed] @ compliance[fixed]
        compliance[identified] = np.linalg.lstsq(rows[:, identified], right, rcond=None)[0]
    return compliance


def first(data, data_set, length):
    matrix = {name: array[data_set, :length] for name, array in data.matrix.items()}
    return matrix, {name: array[data_set, :length] for name, array in data.measured.items()}


def prefixes(strategy, rows):
    start = first_solvable_length(strategy, rows)
    return [(k, s) for k in range(start, CONFIGURATIONS + 1) for s in range(SETS)]


@pytest.fixture
def strategy_called(strategies):
    return lambda name: (UNUSUAL | {"seven": SEVEN} | strategies)[name]


@pytest.mark.parametrize("key", ["kuka", "fanuc"])
@pytest.mark.parametrize(("name", "rows"), [*((name, 6) for name in (*NAMES, *UNUSUAL)), *((name, 3) for name in BY_POSITIONS)])
def test_estimates_of_every_prefix_are_those_of_a_plain_loop(robots, strategy_called, name, rows, key):
    strategy, data = strategy_called(name), data_of(key, rows, robots)
    found = identify(strategy, data.measurements(), 6)[0]
    # One position says two things about three joints that meet in a wrist, so one configuration is not enough.
    for k, s in [(k, s) for k, s in prefixes(strategy, rows) if rows == 6 or k > 1]:
        expected = plain(strategy, *first(data, s, k))
        tolerance = {6: 1e-9, 3: 1e-8}[rows]
        np.testing.assert_allclose(found[k - 1, :, s], expected, rtol=0, atol=tolerance * np.abs(expected).max())


def explicit_covariance(strategy, matrix, measured):
    """The estimator is linear in the measurements: its matrix, column by column, times its own transpose."""
    columns = []
    for name in dict.fromkeys(name for stage in strategy.stages for name in stage.points):
        for index in np.ndindex(measured[name].shape):
            unit = {other: np.zeros_like(array) for other, array in measured.items()}
            unit[name][index] = 1.0
            columns.append(plain(strategy, matrix, unit))
    gain = np.column_stack(columns)
    return gain @ gain.T


def assert_same_covariance(found, expected):
    scale = np.sqrt(np.diag(expected))
    # Correlations, so that the small variances of the stiff joints count as much as the others.
    np.testing.assert_allclose(found / np.outer(scale, scale), expected / np.outer(scale, scale), rtol=0, atol=1e-8)


@pytest.mark.parametrize(("name", "rows"), [*((name, 6) for name in (*NAMES, *UNUSUAL)), *((name, 3) for name in BY_POSITIONS)])
def test_covariance_is_that_of_the_estimator_written_as_one_matrix(robots, strategy_called, name, rows):
    strategy, data = strategy_called(name), data_of("kuka", rows, robots)
    found = identify(strategy, data.measurements(), 6)[1]
    assert found.shape == (CONFIGURATIONS, SETS, 6, 6)
    for k, s in [(1, 0), (2, 1), (CONFIGURATIONS, 2)] if rows == 6 else [(CONFIGURATIONS, 0)]:
        assert_same_covariance(found[k - 1, s], explicit_covariance(strategy, *first(data, s, k)))


@pytest.mark.parametrize("name", [*NAMES, *UNUSUAL])
def test_condition_is_that_of_the_stacked_regressor_of_the_worst_stage(data, strategy_called, name):
    strategy = strategy_called(name)
    found = identify(strategy, data.measurements(), 6)[2]
    for k, s in prefixes(strategy, 6):
        matrix, _ = first(data, s, k)
        stacked = [
            np.concatenate([matrix[point].reshape(-1, 6) for point in stage.points])[:, list(stage.identified)]
            for stage in strategy.stages
        ]
        expected = max(np.linalg.cond(rows) for rows in stacked)
        # Eigenvalues of R^T R lose the square of the condition number: up to 1e4 here.
        assert found[k - 1, s] == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize(
    ("name", "poses", "positions"), [("6DoF", 1, 2), ("3+6DoF-comb", 1, 1), ("5-6DoF-after-4DoF", 1, 2), ("seven", 2, 3)]
)
def test_first_solvable_length_counts_measurements_against_unknowns_of_a_stage(strategy_called, name, poses, positions):
    strategy = strategy_called(name)
    assert (first_solvable_length(strategy, 6), first_solvable_length(strategy, 3)) == (poses, positions)


def test_condition_tells_a_prefix_that_has_measurements_enough_but_not_the_right_ones(robots, strategies):
    # One position of the end-effector cannot tell three joints that meet in a wrist apart.
    strategy, measurements = strategies["4-6DoF-after-3DoF"], data_of("kuka", 3, robots).measurements()
    found = identify(strategy, measurements, 6)[2]
    assert np.isnan(found[0]).all() and (found[1:] < 1e5).all()
    # Nor are its compliances rounding over rounding where no condition is asked for.
    assert np.isnan(estimate_compliance(strategy, measurements, 6)[0][0, 3:]).all()


systems = st.tuples(st.integers(1, 5), st.integers(0, 2), st.integers(1, 4), st.integers(1, 7), st.integers(0, 2**32 - 1))


@given(systems)
def test_triangles_carry_the_normal_equations_of_every_prefix(shape):
    pivots, more, configurations, rows, seed = shape
    system = np.random.default_rng(seed).standard_normal((configurations, rows, pivots + more, 2))
    triangles = prefix_triangles(system.copy(), np.zeros((pivots, pivots + more, 2)))
    for k, s in np.ndindex(configurations, 2):
        stacked = system[: k + 1, ..., s].reshape(-1, pivots + more)
        triangle = triangles[k, :, :pivots, s]
        if len(stacked) >= pivots:
            np.testing.assert_array_equal(np.tril(triangle, -1), 0)
            expected = stacked[:, :pivots].T @ stacked
            np.testing.assert_allclose(triangle.T @ triangles[k, ..., s], expected, rtol=0, atol=1e-12 * rows * configurations)


def test_a_strong_prior_gives_its_values_and_a_weak_one_those_of_least_squares(data, strategies):
    strategy, nominal = strategies["6DoF"], np.tile(np.arange(1.0, 7.0)[:, None] * 1e-6, SETS)
    strong, weak = (
        estimate_compliance(strategy, data.measurements(), 6, Prior(nominal, np.full_like(nominal, std)))[0]
        for std in (1e-9, 1e9)
    )
    np.testing.assert_allclose(strong, np.broadcast_to(nominal, strong.shape), rtol=1e-3)
    plain = estimate_compliance(strategy, data.measurements(), 6)[0]
    np.testing.assert_allclose(weak[3:], plain[3:], rtol=1e-6)


def test_undetermined_are_the_prefixes_whose_condition_is_not_a_number():
    rng = np.random.default_rng(5)
    strategy, sets = Strategy("A", (Stage(("A",), (0, 1, 2)),)), 200
    # The third column is the first but for parts from 1e-4 to 1e-9, on either side of the largest condition.
    regressor = rng.standard_normal((6, 3, 2, sets))
    regressor[:, 2] = regressor[:, 0] + np.logspace(-9, -4, sets) * regressor[:, 2]
    measurements = {"A": Measurements(regressor, np.zeros((6, 2, sets)))}
    triangles = estimate_compliance(strategy, measurements, 3)[1]
    unknown = np.isnan(condition_numbers(strategy, measurements, triangles))
    assert 0 < unknown.sum() < unknown.size
    np.testing.assert_array_equal(undetermined(strategy, 6, triangles), unknown)
