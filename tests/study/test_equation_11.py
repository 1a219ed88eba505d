"""Equation 11 for every prefix, against a plain loop of numpy.linalg.lstsq and against
explicit matrices."""

from functools import cache
from itertools import product

import numpy as np
import pytest
from made_study_blocks import (
    AT,
    deflections_of,
    experiments_of,
    identified,
    pinocchio_regressors,
)
from support import OTHER_CHAINS, random_loads, robot_of, without_tool

from elastocal.mechanics.elastostatics import build_regressor, compute_joint_torques
from elastocal.mechanics.kinematics import compute_poses_and_jacobians
from elastocal.mechanics.robot import set_target_offset
from elastocal.study.equation_11 import (
    MAX_CONDITION_NUMBER,
    Measurements,
    compute_regressors,
    estimate_compliance,
    find_first_solvable_length,
    find_undetermined_prefixes,
)
from elastocal.study.simulation import compute_true_deflections, unpack_experiments
from elastocal.study.strategies import Stage, Strategy

SETS = 3
CONFIGURATIONS = 5
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
# Allowed, though not in the paper: a later stage that fixes no joint need not supersede
# the earlier ones.
REFINED = Strategy(
    "3DoF after 6DoF", (Stage(("6DoF",), tuple(range(6))), Stage(("3DoF",), (0, 1, 2)))
)
RESUMED = Strategy(
    "2DoF again after 3DoF",
    (
        Stage(("2DoF",), (0, 1)),
        Stage(("3DoF",), (2,), (0, 1)),
        Stage(("2DoF",), (0, 1)),
        Stage(("6DoF",), (3, 4, 5), (0, 1, 2)),
    ),
)
SHUFFLED = Strategy(
    "6DoF, joints in any order", (Stage(("6DoF",), (4, 0, 5, 2, 1, 3)),)
)
SEVEN = Strategy("seven", (Stage(("A",), (0, 1)), Stage(("A",), (0, 1, 2, 3, 4, 5, 6))))
BY_POSITIONS = ("6DoF", "3+6DoF-comb", "4-6DoF-after-3DoF", "4-6DoF-after-6+3DoF")
UNUSUAL = {"refined": REFINED, "resumed": RESUMED, "shuffled": SHUFFLED}


class Data:
    """Regressors (sets, configurations, rows, n) and measured deflections (sets,
    configurations, rows) of each point."""

    def __init__(self, robot, rows):
        rng = np.random.default_rng(0)
        loads = random_loads(robot, SETS, CONFIGURATIONS)
        torques = compute_joint_torques(
            robot.chain,
            loads.joint_angles,
            loads.wrench,
            without_tool(robot.chain.end_effector),
        )
        self.matrix = {}
        self.measured = {}
        for point in robot.chain.points:
            jacobian = compute_poses_and_jacobians(
                robot.chain, loads.joint_angles, point
            )[2]
            self.matrix[point.name] = build_regressor(jacobian, torques)[..., :rows, :]
            deflection = compute_true_deflections(robot, loads, point, "end_effector")[
                ..., :rows
            ]
            self.measured[point.name] = deflection + 2e-4 * rng.standard_normal(
                deflection.shape
            )

    def measurements(self):
        return {
            name: Measurements(
                self.matrix[name].transpose(2, 3, 1, 0), self.measured[name].T
            )
            for name in self.matrix
        }


@cache
def data_of(robot_key, rows, load):
    robot = load(robot_key)
    return Data(
        set_target_offset(robot, (0.1, 0.05, 0.2)) if rows == 3 else robot, rows
    )


@pytest.fixture
def robots(kuka, fanuc):
    return {"kuka": kuka, "fanuc": fanuc}.__getitem__


def plain(strategy, matrix, measured, joints=6):
    """One data set, one prefix: the stages one after the other by numpy.linalg.lstsq;
    (configurations, rows, ...) per point."""
    compliance = np.full(joints, np.nan)
    for stage in strategy.stages:
        rows = np.concatenate(
            [matrix[name].reshape(-1, joints) for name in stage.points]
        )
        right = np.concatenate([measured[name].ravel() for name in stage.points])
        fixed = list(stage.fixed)
        identified = list(stage.identified)
        right = right - rows[:, fixed] @ compliance[fixed]
        compliance[identified] = np.linalg.lstsq(
            rows[:, identified], right, rcond=None
        )[0]
    return compliance


@pytest.fixture
def strategy_called(strategies):
    return lambda name: (UNUSUAL | {"seven": SEVEN} | strategies)[name]


@pytest.mark.parametrize("key", ["kuka", "fanuc"])
@pytest.mark.parametrize(
    ("name", "rows"),
    [
        *((name, 6) for name in (*NAMES, *UNUSUAL)),
        *((name, 3) for name in BY_POSITIONS),
    ],
)
def test_estimates_of_every_prefix_are_those_of_a_plain_loop(
    robots, strategy_called, name, rows, key
):
    strategy = strategy_called(name)
    data = data_of(key, rows, robots)
    compliance = estimate_compliance(strategy, data.measurements(), 6)[0]
    # One position gives two equations for three joints that meet in a wrist, so one
    # configuration is not enough.
    for k, s in product(range(1 if rows == 6 else 2, CONFIGURATIONS + 1), range(SETS)):
        matrix = {name: values[s, :k] for name, values in data.matrix.items()}
        measured = {name: values[s, :k] for name, values in data.measured.items()}
        expected = plain(strategy, matrix, measured)
        tolerance = {6: 1e-9, 3: 1e-8}[rows]
        np.testing.assert_allclose(
            compliance[k - 1, :, s],
            expected,
            rtol=0,
            atol=tolerance * np.abs(expected).max(),
        )


@pytest.mark.parametrize(
    ("name", "poses", "positions"),
    [
        ("6DoF", 1, 2),
        ("3+6DoF-comb", 1, 1),
        ("5-6DoF-after-4DoF", 1, 2),
        ("seven", 2, 3),
    ],
)
def test_first_solvable_length_counts_measurements_against_unknowns_of_a_stage(
    strategy_called, name, poses, positions
):
    strategy = strategy_called(name)
    assert (
        find_first_solvable_length(strategy, 6),
        find_first_solvable_length(strategy, 3),
    ) == (
        poses,
        positions,
    )


def test_a_prefix_with_enough_measurements_but_not_the_right_ones_is_undetermined(
    robots, strategies
):
    # One position of the end-effector cannot distinguish three joints that meet in a
    # wrist.
    strategy = strategies["4-6DoF-after-3DoF"]
    measurements = data_of("kuka", 3, robots).measurements()
    compliance, triangles = estimate_compliance(strategy, measurements, 6)
    unknown = find_undetermined_prefixes(strategy, 3, triangles)
    assert unknown[0].all() and not unknown[1:].any()
    # Its compliances are NaN even if nobody asks for the condition number; they would be
    # quotients of rounding errors.
    assert np.isnan(compliance[0, 3:]).all()


def test_prefixes_above_the_largest_condition_number_are_undetermined():
    rng = np.random.default_rng(5)
    strategy = Strategy("A", (Stage(("A",), (0, 1, 2)),))
    sets = 200
    # The third column differs from the first by relative amounts from 1e-4 to 1e-9, on
    # both sides of the largest condition number.
    matrix = rng.standard_normal((6, 3, 2, sets))
    matrix[:, 2] = matrix[:, 0] + np.logspace(-9, -4, sets) * matrix[:, 2]
    triangles = estimate_compliance(
        strategy, {"A": Measurements(matrix, np.zeros((6, 2, sets)))}, 3
    )[1]
    undetermined = find_undetermined_prefixes(strategy, 6, triangles)
    for length in (1, 2):
        conditions = np.array(
            [
                np.linalg.cond(
                    np.moveaxis(matrix[:, :, :length, s], 2, 0).reshape(-1, 3)
                )
                for s in range(sets)
            ]
        )
        clear = np.abs(np.log(conditions / MAX_CONDITION_NUMBER)) > 0.1
        np.testing.assert_array_equal(
            undetermined[length - 1][clear], (conditions > MAX_CONDITION_NUMBER)[clear]
        )
        assert 0 < undetermined[length - 1].sum() < sets


def test_compliances_are_identified_from_the_first_loaded_configuration_on(
    kuka, strategies
):
    (experiments,) = experiments_of(kuka, sets=2)
    # No load in the first configuration of one data set and the first two of the other.
    empty = np.array([True, False, False, False, True, True, False, False])
    for name in ("fx", "fy", "fz", "mx", "my", "mz"):
        experiments[name] = np.where(empty, 0.0, experiments[name])
    table = identified(
        kuka, strategies["6DoF"], [experiments], deflections_of(kuka, [experiments])
    )
    for joint in range(1, 7):
        np.testing.assert_array_equal(np.isnan(table[f"compliance_{joint}"]), empty)


@pytest.mark.parametrize("rows", [3, 6])
@pytest.mark.parametrize("at", AT)
def test_regressors_are_those_of_equation_10_by_pinocchio(at, rows):
    robot = robot_of(OTHER_CHAINS["seven joints"])
    (block,) = experiments_of(robot, sets=2, configurations=3)
    regressors = compute_regressors(
        unpack_experiments(block), robot.chain, ("elbow", "flange"), rows, at
    )
    assert set(regressors) == {"elbow", "flange"}
    for name, matrix in regressors.items():
        assert matrix.shape == (rows, 7, 3, 2)
        expected = pinocchio_regressors(robot.chain, block, name, at, rows).reshape(
            2, 3, rows, 7
        )
        np.testing.assert_allclose(
            matrix, expected.transpose(2, 3, 1, 0), rtol=0, atol=1e-9
        )
