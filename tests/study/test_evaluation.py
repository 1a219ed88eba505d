"""Averages over data sets and their Monte Carlo errors."""

from itertools import pairwise

import numpy as np
import pytest
from made_studies import studies_of
from support import random_loads

from elastocal.study.evaluation import (
    average_estimates,
    build_metrics_table,
    build_over_studies_table,
    build_replicates_table,
    find_length_with_error,
    unpack_weights,
)
from elastocal.study.metrics import compute_position_errors, make_validation_set
from elastocal.study.schemas import METRICS
from elastocal.study.simulation import (
    compute_true_deflections,
    draw_bootstrap_weights,
    draw_weight_blocks,
)

SETS = 60
LENGTHS = 3
REPLICATES = 25
TESTS = 30
METHODS = ("stiffness", "compliance")


@pytest.fixture(scope="module")
def judge(kuka):
    loads = random_loads(kuka, 1, TESTS)
    return make_validation_set(
        kuka,
        loads,
        compute_true_deflections(kuka, loads, kuka.chain.end_effector, "end_effector"),
    )


@pytest.fixture(scope="module")
def estimates(kuka):
    """Compliances that scatter by 10 % of their values, less at each length."""
    scatter = (
        np.random.default_rng(1).standard_normal((SETS, LENGTHS, 6))
        / np.arange(1, LENGTHS + 1)[:, None]
    )
    return kuka.compliance * (1 + 0.1 * np.clip(scatter, -3, 3))


@pytest.fixture(scope="module")
def weights():
    return draw_bootstrap_weights(1, "kuka", range(SETS), REPLICATES)


@pytest.fixture(scope="module")
def counts():
    """How often each test configuration counts."""
    return unpack_weights([*draw_weight_blocks("kuka", 1, SETS, TESTS, REPLICATES)][-1])


def blocks_of(estimates, weights, *cuts):
    edges = [0, *cuts, len(estimates)]
    return [(estimates[a:b], weights[:, a:b]) for a, b in pairwise(edges)]


@pytest.mark.parametrize("method", METHODS)
def test_averages_equal_explicit_ones_for_any_blocks(
    judge, estimates, weights, counts, method
):
    averages = average_estimates(
        iter(blocks_of(estimates, weights, 1, 20, 21)), judge, method, counts
    )
    for replicate in (0, 1, REPLICATES):
        drawn = np.repeat(estimates, weights[replicate].astype(int), axis=0)
        expected = {
            "stiffness": lambda drawn: 1 / (1 / drawn).mean(axis=0),
            "compliance": lambda drawn: drawn.mean(axis=0),
        }[method](drawn)
        np.testing.assert_allclose(averages.compliance[replicate], expected, rtol=1e-12)
        tests = counts[replicate].astype(int)
        deviation = np.repeat(
            compute_position_errors(judge, expected), tests, axis=1
        ).mean(axis=1)
        np.testing.assert_allclose(
            averages.initial_deviation[replicate],
            np.repeat(judge.initial_errors, tests).mean(),
            rtol=1e-12,
        )
        np.testing.assert_allclose(averages.deviation[replicate], deviation, rtol=1e-9)
    relative = estimates / judge.reference
    np.testing.assert_allclose(
        averages.relative_spread,
        (relative.std(axis=0) / relative.mean(axis=0)).max(axis=-1),
        rtol=1e-9,
    )
    assert (averages.nonpositive_share == 0).all()


def test_nonpositive_compliances_are_counted_by_data_sets_and_make_a_length_untrustworthy(
    judge, estimates, weights, counts
):
    spoiled = estimates.copy()
    spoiled[:3, 1, 4] *= -1
    spoiled[0, 1, 5] = 0.0
    with np.errstate(divide="ignore", invalid="ignore"):
        averages = average_estimates(
            blocks_of(spoiled, weights, 2), judge, "stiffness", counts
        )
        table = build_metrics_table(averages, judge.reference, (0, 1))
    np.testing.assert_allclose(averages.nonpositive_share, [0, 3 / SETS, 0])
    np.testing.assert_array_equal(table["trustworthy"], [True, False, True])


def test_metrics_are_equations_13_and_14_of_the_averages(
    judge, estimates, weights, counts
):
    averages = average_estimates(
        blocks_of(estimates, weights), judge, "stiffness", counts
    )
    table = build_metrics_table(averages, judge.reference, (0, 1))
    assert set(table) == {column.name for column in METRICS.for_joints(6).columns}
    stiffness = (1 / estimates).mean(axis=0)
    delta = 100 * (stiffness * judge.reference - 1)
    np.testing.assert_array_equal(table["length"], [1, 2, 3])
    for joint in range(6):
        np.testing.assert_allclose(
            table[f"compliance_{joint + 1}"], 1 / stiffness[:, joint], rtol=1e-12
        )
        np.testing.assert_allclose(
            table[f"delta_k_{joint + 1}"], delta[:, joint], rtol=0, atol=1e-10
        )
    np.testing.assert_allclose(table["k_sigma"], delta.sum(axis=1), rtol=0, atol=1e-10)
    np.testing.assert_allclose(
        table["k_sigma_fixed_joints"], delta[:, :2].sum(axis=1), rtol=0, atol=1e-10
    )
    np.testing.assert_array_equal(table["deviation"], averages.deviation[0])


def test_replicates_start_after_the_first_and_their_spread_is_the_standard_error(
    judge, estimates, weights, counts
):
    averages = average_estimates(
        blocks_of(estimates, weights), judge, "stiffness", counts
    )
    table = build_replicates_table(averages, judge.reference, (0, 1))
    assert len(table["replicate"]) == REPLICATES * LENGTHS
    np.testing.assert_array_equal(
        np.unique(table["replicate"]), np.arange(1, REPLICATES + 1)
    )
    row = (table["replicate"] == 4) & (table["length"] == 2)
    assert table["deviation"][row] == averages.deviation[4, 1]
    delta = 100 * (judge.reference / averages.compliance[4, 1] - 1)
    np.testing.assert_allclose(table["k_sigma"][row], delta.sum(), rtol=1e-9)
    np.testing.assert_allclose(
        table["k_sigma_fixed_joints"][row], delta[:2].sum(), rtol=1e-9
    )
    metrics = build_metrics_table(averages, judge.reference, (0, 1))
    for name in ("k_sigma", "deviation", "initial_deviation"):
        spread = table[name].reshape(REPLICATES, LENGTHS).std(axis=0, ddof=1)
        np.testing.assert_allclose(metrics[f"{name}_std_error"], spread, rtol=1e-12)


@pytest.mark.parametrize(
    ("limit", "ends", "length", "lengths"),
    [
        (1.0, (0.5, 0.5, 0.5), 2.0, (2, 3, 2)),
        (1.0, (0.5, 1.5, -2.0), 2.0, (2, 4.5, 6)),
        (2.5, (0.5, 0.55, -0.6), 2.0, (2, 3, 1)),
        (0.6, (0.5, 0.55, -0.6), 3.0, (3, 3, 3)),
        (0.25, (0.5, 0.75, -1.0), np.inf, (6, 9, 12)),
    ],
)
def test_the_error_of_a_length_is_the_spread_of_extrapolated_replicates(
    limit, ends, length, lengths
):
    """Curves are extrapolated as one over the length: from 0.5, 0.75 and 1 at length 3 to
    0.25."""
    replicates = np.column_stack([[3.0, 3.0, 2.0], [0.9, 2.6, 0.9], ends])
    first_length, error = find_length_with_error(
        np.array([3.0, 0.9, 0.5]), replicates, limit
    )
    assert first_length == length and error == pytest.approx(np.std(lengths, ddof=1))


def test_table_4_over_studies_is_their_median_with_a_spread_that_one_outlier_does_not_move():
    """The scores are biases of 20, 22, 24 and an outlier over the length, in percent and
    µm."""
    frame = studies_of(biases=(20.0, 22.0, 24.0, 22.0, 900.0)).assign(
        mean_square=25e-12
    )
    for name in ("k_sigma", "k_sigma_fixed_joints", "deviation"):
        frame[f"{name}_mean_compliance"] = frame[name] / 10
    usual, averaged = build_over_studies_table(
        frame, 20, {"k_sigma": 2.0, "deviation": 4.0}
    ).to_dict("records")
    assert [usual["average"], averaged["average"]] == ["stiffness", "compliance"]
    assert usual["dev_20_um"] == pytest.approx(1.1) and usual[
        "dev_20_um_std"
    ] == pytest.approx(1.4826 * 0.1)
    assert (
        usual["n_k_sigma_2_percent"],
        usual["n_k_sigma_fixed_joints_2_percent"],
        usual["n_dev_4_um"],
    ) == (11, 6, 6)
    assert averaged["k_sigma_20_percent"] == pytest.approx(0.11) and usual[
        "rms_20_um"
    ] == pytest.approx(5.0)
