"""Expectations from the design of the data sets, against many simulated studies of few."""

import numpy as np
import pytest
from made_studies import SIZE, USUAL, blocks_of
from made_study_blocks import PAPER, experiments_of, judge

from elastocal.study.steps.design import design_blocks
from elastocal.study.steps.expect import expected_scores


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
