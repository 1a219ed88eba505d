"""Bootstrap weights: each replicate counts everything a random number of times, the first exactly once."""

import numpy as np
import pytest

from elastocal.study.bootstrap import bootstrap_test_weights, bootstrap_weights


def test_bootstrap_counts_every_set_once_and_then_poisson_times():
    weights = bootstrap_weights(1, "kuka", range(400), 100)
    assert weights.shape == (101, 400)
    assert (weights[0] == 1).all() and (weights[1:] == np.round(weights[1:])).all() and (weights >= 0).all()
    # Mean and variance of a Poisson number are both one; its fourth central moment is four.
    assert weights[1:].mean() == pytest.approx(1, abs=5 / np.sqrt(40_000))
    assert weights[1:].var() == pytest.approx(1, abs=5 * np.sqrt(3 / 40_000))


def test_bootstrap_weights_do_not_depend_on_blocks_or_on_the_number_of_replicates():
    whole = bootstrap_weights(1, "kuka", range(10), 20)
    np.testing.assert_array_equal(
        np.hstack([bootstrap_weights(1, "kuka", part, 20) for part in (range(3), range(3, 10))]), whole
    )
    np.testing.assert_array_equal(bootstrap_weights(1, "kuka", range(10), 5), whole[:6])


def test_bootstrap_counts_every_test_configuration_once_and_then_poisson_times():
    weights = bootstrap_test_weights(1, "kuka", 400, 100)
    assert weights.shape == (101, 400) and (weights[0] == 1).all()
    assert weights[1:].mean() == pytest.approx(1, abs=5 / np.sqrt(40_000))
    assert weights[1:].var() == pytest.approx(1, abs=5 * np.sqrt(3 / 40_000))
