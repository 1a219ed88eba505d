"""Averages over data sets, their Monte Carlo errors, and the accuracy of one data set."""

from itertools import pairwise

import numpy as np
import pytest
from made_study_blocks import OFFSET, experiments_of, pinocchio_regressors
from made_study_blocks import judge as judged
from support import random_loads

from elastocal.mechanics.elastostatics import joint_torques
from elastocal.mechanics.kinematics import poses_and_jacobians
from elastocal.mechanics.robot import with_target_offset
from elastocal.study import simulation
from elastocal.study.evaluation import (
    accuracy_sums,
    accuracy_table,
    average,
    bound_blocks,
    find_length,
    metrics_table,
    replicates_table,
    to_weights,
)
from elastocal.study.metrics import make_judge, mean_deviation, position_errors
from elastocal.study.simulation import bootstrap_weights, to_experiments, true_deflections, weight_blocks

SETS, LENGTHS, REPLICATES, TESTS = 60, 3, 25, 30
METHODS = ("stiffness", "compliance", "median")
SCORES = ("averaged_model", "each_data_set")


@pytest.fixture(scope="module")
def judge(kuka):
    loads = random_loads(kuka, 1, TESTS)
    return make_judge(kuka, loads, true_deflections(kuka, loads, kuka.chain.end_effector, "end_effector"))


@pytest.fixture(scope="module")
def estimates(kuka):
    """Compliances that scatter by 10 % of their values, less at each length."""
    scatter = np.random.default_rng(1).standard_normal((SETS, LENGTHS, 6)) / np.arange(1, LENGTHS + 1)[:, None]
    return kuka.compliance * (1 + 0.1 * np.clip(scatter, -3, 3))


@pytest.fixture(scope="module")
def weights():
    return bootstrap_weights(1, "kuka", range(SETS), REPLICATES)


@pytest.fixture(scope="module")
def counts():
    """How often each test configuration counts."""
    return to_weights([*weight_blocks("kuka", 1, SETS, TESTS, REPLICATES)][-1])


def blocks_of(estimates, weights, *cuts):
    edges = [0, *cuts, len(estimates)]
    return [(estimates[a:b], weights[:, a:b]) for a, b in pairwise(edges)]


@pytest.mark.parametrize("score", SCORES)
@pytest.mark.parametrize("method", METHODS)
def test_averages_are_those_written_out_whatever_the_blocks(judge, estimates, weights, counts, method, score):
    found = average(iter(blocks_of(estimates, weights, 1, 20, 21)), judge, method, score, counts)
    for replicate in (0, 1, REPLICATES):
        drawn = np.repeat(estimates, weights[replicate].astype(int), axis=0)
        expected = {
            "stiffness": lambda drawn: 1 / (1 / drawn).mean(axis=0),
            "compliance": lambda drawn: drawn.mean(axis=0),
            "median": lambda drawn: np.median(drawn, axis=0),
        }[method](drawn)
        np.testing.assert_allclose(found.compliance[replicate], expected, rtol=1e-12)
        tests = counts[replicate].astype(int)
        if score == "averaged_model":
            deviation = np.repeat(position_errors(judge, expected), tests, axis=1).mean(axis=1)
        else:
            deviation = mean_deviation(judge, drawn).mean(axis=0)
        np.testing.assert_allclose(
            found.initial_deviation[replicate], np.repeat(judge.initial_errors, tests).mean(), rtol=1e-12
        )
        np.testing.assert_allclose(found.deviation[replicate], deviation, rtol=1e-9)
    relative = estimates / judge.reference
    np.testing.assert_allclose(found.relative_spread, (relative.std(axis=0) / relative.mean(axis=0)).max(axis=-1), rtol=1e-9)
    assert (found.nonpositive_share == 0).all()


def test_share_of_nonpositive_compliances_counts_data_sets_and_takes_trust_away(judge, estimates, weights, counts):
    spoiled = estimates.copy()
    spoiled[:3, 1, 4] *= -1
    spoiled[0, 1, 5] = 0.0
    with np.errstate(divide="ignore", invalid="ignore"):
        averages = average(blocks_of(spoiled, weights, 2), judge, "stiffness", "averaged_model", counts)
        table = metrics_table(averages, judge.reference, (0, 1))
    np.testing.assert_allclose(averages.nonpositive_share, [0, 3 / SETS, 0])
    np.testing.assert_array_equal(table["trustworthy"], [True, False, True])


def test_prefixes_without_estimates_stay_not_a_number_and_are_not_trusted(judge, estimates, weights, counts):
    short = estimates.copy()
    short[:, 0] = np.nan
    table = metrics_table(
        average(blocks_of(short, weights), judge, "stiffness", "averaged_model", counts), judge.reference, (0,)
    )
    for name in ("compliance_1", "delta_k_6", "k_sigma", "deviation"):
        assert np.isnan(table[name][0]) and np.isfinite(table[name][1:]).all()
    np.testing.assert_array_equal(table["trustworthy"], [False, True, True])


def test_metrics_are_equations_13_and_14_of_the_averages(judge, estimates, weights, counts):
    averages = average(blocks_of(estimates, weights), judge, "stiffness", "averaged_model", counts)
    table = metrics_table(averages, judge.reference, (0, 1))
    stiffness = (1 / estimates).mean(axis=0)
    delta = 100 * (stiffness * judge.reference - 1)
    np.testing.assert_array_equal(table["length"], [1, 2, 3])
    for joint in range(6):
        np.testing.assert_allclose(table[f"compliance_{joint + 1}"], 1 / stiffness[:, joint], rtol=1e-12)
        np.testing.assert_allclose(table[f"delta_k_{joint + 1}"], delta[:, joint], rtol=0, atol=1e-10)
    np.testing.assert_allclose(table["k_sigma"], delta.sum(axis=1), rtol=0, atol=1e-10)
    np.testing.assert_allclose(table["k_sigma_fixed_joints"], delta[:, :2].sum(axis=1), rtol=0, atol=1e-10)
    np.testing.assert_array_equal(table["deviation"], averages.deviation[0])


def test_bootstrap_standard_error_of_a_mean_is_that_of_theory(judge):
    sets, replicates = 400, 1000
    estimates = judge.reference * (1 + 0.05 * np.random.default_rng(3).standard_normal((sets, 1, 6)))
    weights = bootstrap_weights(2, "kuka", range(sets), replicates)
    tests = np.ones((1 + replicates, TESTS))
    averages = average([(estimates, weights)], judge, "compliance", "averaged_model", tests)
    table = metrics_table(averages, judge.reference, (0,))
    for joint in range(6):
        expected = estimates[:, 0, joint].std(ddof=1) / np.sqrt(sets)
        # A standard deviation from 1000 replicates is known to 1 / sqrt(2000) = 2.2 %, and sets - 1 / sets weighs little.
        assert table[f"compliance_{joint + 1}_std_error"][0] == pytest.approx(expected, rel=0.1)


def test_replicates_are_every_replicate_at_every_length_without_the_first(judge, estimates, weights, counts):
    averages = average(blocks_of(estimates, weights), judge, "stiffness", "averaged_model", counts)
    table = replicates_table(averages, judge.reference, (0, 1))
    assert len(table["replicate"]) == REPLICATES * LENGTHS
    np.testing.assert_array_equal(np.unique(table["replicate"]), np.arange(1, REPLICATES + 1))
    row = (table["replicate"] == 4) & (table["length"] == 2)
    assert table["deviation"][row] == averages.deviation[4, 1]
    delta = 100 * (judge.reference / averages.compliance[4, 1] - 1)
    np.testing.assert_allclose(table["k_sigma"][row], delta.sum(), rtol=1e-9)
    np.testing.assert_allclose(table["k_sigma_fixed_joints"][row], delta[:2].sum(), rtol=1e-9)


def test_standard_errors_are_the_spread_of_the_replicates(judge, estimates, weights, counts):
    averages = average(blocks_of(estimates, weights), judge, "stiffness", "averaged_model", counts)
    metrics, replicates = (make(averages, judge.reference, (0, 1)) for make in (metrics_table, replicates_table))
    for name in ("k_sigma", "k_sigma_fixed_joints", "deviation", "initial_deviation"):
        spread = replicates[name].reshape(REPLICATES, LENGTHS).std(axis=0, ddof=1)
        np.testing.assert_allclose(metrics[f"{name}_std_error"], spread, rtol=1e-12)


def test_accuracy_is_that_of_single_data_sets_averaged_whatever_the_blocks(judge, estimates):
    lengths = [1, 3]
    parts = [accuracy_sums(part[:, [0, 2]], judge) for part in (estimates[:1], estimates[1:33], estimates[33:])]
    table = accuracy_table(sum(parts), lengths)
    np.testing.assert_array_equal(table["length"], lengths)
    for row, length in enumerate(lengths):
        compliance = estimates[:, length - 1]
        errors = position_errors(judge, compliance)
        sorted_errors = np.sort(errors, axis=1)
        single = {"mean": errors.mean(axis=1), "max": errors.max(axis=1), "p95": sorted_errors[:, 29 - 1]}
        for name, values in single.items():
            assert table[name][row] == pytest.approx(values.mean(), rel=1e-12)
            assert table[f"{name}_std_error"][row] == pytest.approx(values.std(ddof=1) / np.sqrt(SETS), rel=1e-9)
        squares = {"rms": (errors**2).mean(axis=1)}
        for joint in range(6):
            squares[f"relative_error_{joint + 1}"] = 1e4 * (compliance[:, joint] / judge.reference[joint] - 1) ** 2
        for name, values in squares.items():
            root = np.sqrt(values.mean())
            assert table[name][row] == pytest.approx(root, rel=1e-9)
            # The error of a root of a mean is that of the mean over twice the root.
            expected = values.std(ddof=1) / np.sqrt(SETS) / (2 * root)
            assert table[f"{name}_std_error"][row] == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize(
    ("limit", "ends", "length", "lengths"),
    [
        (1.0, (0.5, 0.5, 0.5), 2.0, (2, 3, 2)),
        (1.0, (0.5, 1.5, -2.0), 2.0, (2, 4.5, 2)),
        (2.5, (0.5, 0.55, -0.6), 2.0, (2, 3, 1)),
        (0.6, (0.5, 0.55, -0.6), 3.0, (3, 3, 3)),
        (0.25, (0.5, 0.75, -1.0), np.inf, (6, 9, 12)),
    ],
)
def test_a_length_comes_with_the_spread_of_replicates_that_go_on_beyond_their_curves(limit, ends, length, lengths):
    """As one over the length: from 0.5, 0.75 and 1 at length 3 to 0.25."""
    replicates = np.column_stack([[3.0, 3.0, 2.0], [0.9, 2.6, 0.9], ends])
    found, error = find_length(np.array([3.0, 0.9, 0.5]), replicates, limit)
    assert found == length and error == pytest.approx(np.std(lengths, ddof=1))


def test_bounds_of_a_target_off_the_flange_are_those_of_a_load_at_the_flange(kuka):
    moved, experiments = with_target_offset(kuka, OFFSET), experiments_of(kuka)
    scores, loads = judged(kuka), to_experiments(experiments[0])
    (found,) = bound_blocks(experiments, moved.chain, [("6DoF",)], 6, "end_effector", scores)
    torques = joint_torques(kuka.chain, loads.joint_angles, loads.wrench, kuka.chain.end_effector)
    rows = poses_and_jacobians(moved.chain, loads.joint_angles, moved.chain.end_effector)[2] * torques[..., None, :]
    bounds = [np.trace(scores.form[:-1, :-1] @ np.linalg.inv(np.einsum("kri,krj->ij", one, one))) for one in rows]
    assert found["rms_per_noise"][-1] == pytest.approx(np.sqrt(np.mean(bounds)), rel=1e-6)


def test_the_bound_is_the_root_mean_square_over_the_data_sets_of_all_blocks(kuka, monkeypatch):
    monkeypatch.setattr(simulation, "SETS_PER_BLOCK", 2)
    experiments, scores = experiments_of(kuka, sets=3), judged(kuka)
    (found,) = bound_blocks(experiments, kuka.chain, [("3DoF", "6DoF")], 6, "end_effector", scores)
    assert len(experiments) == 2 and found["length"].tolist() == [1, 2, 3, 4]
    moment, squares = scores.form[:-1, :-1], []
    for block in experiments:
        parts = [pinocchio_regressors(kuka.chain, block, name).reshape(-1, 4, 6, 6) for name in ("3DoF", "6DoF")]
        for number in range(len(parts[0])):
            matrices = [np.concatenate([part[number, :length].reshape(-1, 6) for part in parts]) for length in (1, 2, 3, 4)]
            squares.append([np.trace(moment @ np.linalg.inv(matrix.T @ matrix)) for matrix in matrices])
    np.testing.assert_allclose(found["rms_per_noise"], np.sqrt(np.mean(squares, axis=0)), rtol=1e-6)


def test_positions_on_the_last_axis_never_bound_its_joint(kuka):
    """The flange lies on the axis of joint 6, so that no position of it shows that joint's compliance."""
    (found,) = bound_blocks(experiments_of(kuka), kuka.chain, [("6DoF",)], 3, "end_effector", judged(kuka))
    assert np.isinf(found["rms_per_noise"]).all()
