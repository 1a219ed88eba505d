"""Expectations in closed form, against simulated estimates."""

from dataclasses import replace

import numpy as np
import pytest
from made_studies import SIZE, USUAL, blocks_of
from made_study_blocks import PAPER, deflections_of, evaluated_in_one_block, experiments_of, identified, judge

from elastocal.study.identify import design_blocks
from elastocal.study.metrics import mean_deviation, position_errors
from elastocal.study.repeated import expected_compliance, expected_deviation, expected_scores

DRAWS = 200_000


def test_the_averaged_stiffness_has_the_bias_of_second_order():
    """Monte Carlo error 2e-5; what is left out is 3 (s/c)^4, 3e-5 here."""
    true, relative = np.array([0.5e-6, 2e-6]), np.array([0.02, 0.05])
    drawn = true * (1 + relative * np.random.default_rng(1).standard_normal((DRAWS, 2)))
    found = expected_compliance(true, (relative * true) ** 2, "stiffness")
    np.testing.assert_allclose(found, 1 / (1 / drawn).mean(axis=0), rtol=3e-4)
    assert (found < true).all()


@pytest.mark.parametrize("method", ["compliance", "median"])
def test_means_and_medians_of_compliances_have_none(method):
    true = np.array([0.5e-6, 2e-6])
    np.testing.assert_array_equal(expected_compliance(true, true**2, method), true)


@pytest.mark.parametrize("bias", [0.0, 0.01, 0.3])
def test_the_expected_deviation_is_the_mean_over_normal_models(kuka, bias):
    """With the bias far below the scatter, alike and far above; 4,000 draws have an error of 1 %."""
    scores = judge(kuka)
    rng = np.random.default_rng(2)
    root = 0.02 * kuka.compliance[:, None] * rng.standard_normal((6, 6))
    mean = kuka.compliance * (1 + bias)
    models = mean + rng.standard_normal((4000, 6)) @ root.T
    found = expected_deviation(scores, mean[None], (root @ root.T)[None])
    assert found[0] == pytest.approx(mean_deviation(scores, models[None]).mean(), rel=0.03)


def test_forms_give_the_squared_error_of_each_test_configuration(kuka):
    scores, model = judge(kuka), 1.2 * kuka.compliance
    whole = np.append(model - scores.reference, 1.0)
    np.testing.assert_allclose((scores.forms @ whole) @ whole, position_errors(scores, model[None])[0] ** 2, rtol=1e-9)


@pytest.fixture(scope="module")
def some(strategies):
    return [strategies[name] for name in ("6DoF", "6DoF-after-3DoF", "4-6DoF-after-3DoF")]


def test_each_study_has_a_block_for_each_strategy(kuka, some):
    blocks = blocks_of(kuka, some)
    names = [strategy.name for strategy in some]
    assert [(block["study"][0], block["strategy"]) for block in blocks] == [(n, name) for n in (1, 2) for name in names]
    assert (blocks[0]["length"] == np.arange(1, 6)).all()


@pytest.mark.parametrize("average", ["stiffness", "compliance", "median"])
def test_scores_are_those_of_the_pipeline_for_the_same_data_sets(kuka, some, average):
    """Study number 0, which is that of the pipeline."""
    found = blocks_of(kuka, some, replace(USUAL, average=average), studies=[0])
    experiments = experiments_of(kuka, sets=4, configurations=5)
    deflections, scores = deflections_of(kuka, experiments, 1e-5), judge(kuka)
    for strategy, block in zip(some, found, strict=True):
        table = identified(kuka, strategy, experiments, deflections)
        metrics = evaluated_in_one_block(table, scores, strategy.fixed_joints, average, 10, [5])[0]
        for name in ("compliance_1", "compliance_6", "k_sigma", "k_sigma_fixed_joints", "deviation"):
            np.testing.assert_allclose(block[name][1:], metrics[name][1:], rtol=1e-6, err_msg=name)


def test_averages_of_compliances_and_errors_of_single_data_sets_stand_beside_the_scores(kuka, some):
    (usual,) = blocks_of(kuka, some[:1], studies=[0])
    (plain,) = blocks_of(kuka, some[:1], replace(USUAL, average="compliance"), studies=[0])
    for name in ("k_sigma", "k_sigma_fixed_joints", "deviation"):
        np.testing.assert_array_equal(usual[f"{name}_mean_compliance"][1:], plain[name][1:])
    # A sign averages out, a norm does not, and a single data set has all of its noise.
    assert (np.abs(usual["deviation_signed"][1:]) < plain["deviation"][1:]).all()
    assert (np.sqrt(usual["mean_square"][1:]) > usual["deviation_mean_compliance"][1:]).all()


def expected(robot, strategy, noise, sets=400, **options):
    designs = design_blocks(experiments_of(robot, sets, configurations=20), robot.chain, strategy, 6, "end_effector")
    given = {"noise_free": None, "method": "stiffness", "deviation_of": "averaged_model"} | options
    return expected_scores(
        designs,
        given["noise_free"],
        noise,
        robot,
        judge(robot),
        strategy.fixed_joints,
        given["method"],
        given["deviation_of"],
    )


def test_they_are_what_studies_scatter_about(kuka, strategies):
    """12 studies of 400 data sets: the mean of k_sigma is known to 5 %, that of dev to 6 %."""
    assert PAPER is USUAL.loading
    strategy, noise = strategies["4-6DoF-after-3DoF"], 200e-6
    size = type(SIZE)(data_sets=400, configurations=20, tests=200, noise=noise)
    blocks = blocks_of(kuka, [strategy], USUAL, size, studies=range(1, 13))
    found = expected(kuka, strategy, noise)
    for name in ("k_sigma", "k_sigma_fixed_joints", "deviation"):
        mean = np.mean([block[name][19] for block in blocks])
        assert found[name][19] == pytest.approx(mean, rel=0.2), name


def test_the_bias_goes_with_the_variance_and_falls_as_one_over_the_length(kuka, strategies):
    few = expected(kuka, strategies["6DoF"], 1e-5)
    twice = expected(kuka, strategies["6DoF"], 2e-5)
    np.testing.assert_allclose(twice["k_sigma"][4:], 4 * few["k_sigma"][4:], rtol=1e-6)
    # Faster at first, where some random data sets hardly determine a compliance.
    assert 0.35 < few["k_sigma"][19] / few["k_sigma"][9] < 0.5


def test_what_the_linearisation_does_without_noise_is_added(kuka, strategies):
    shifted = np.tile(1.01 * kuka.compliance, (20, 1))
    usual, moved = (expected(kuka, strategies["6DoF"], 1e-5, noise_free=start) for start in (None, shifted))
    np.testing.assert_allclose(moved["k_sigma"][5:] - usual["k_sigma"][5:], 6 * 100 * (1 / 1.01 - 1), rtol=1e-3)
