"""Intervals hold what they claim, whatever a regression thinks of itself."""

import numpy as np
import pytest
from made_remainders import made_inputs

from elastocal.remainder.intervals import NORMAL_WIDTH, calibrated
from elastocal.remainder.protocol import Prediction


def boasting(factor):
    """A predictor of zero that states a multiple of the noise, which grows with the first angle."""
    return lambda there: Prediction(np.zeros((len(there), 3)), factor * spread(there))


def spread(there):
    return np.repeat(1e-4 * (1.0 + np.abs(there.joint_angles[:, :1])), 3, axis=1)


@pytest.mark.parametrize("factor", [0.1, 1.0, 30.0])
def test_intervals_hold_95_percent_and_keep_their_shape(factor):
    inputs, _ = made_inputs(600, seed=1)
    off = np.random.default_rng(2).normal(size=(600, 3)) * spread(inputs)
    honest = calibrated(boasting(factor), [np.abs(off) / (factor * spread(inputs))])
    there, _ = made_inputs(2000, seed=3)
    found = honest(there)
    # 1,800 scores and 6,000 coordinates: standard errors of 0.5 and 0.3 %.
    inside = np.abs(np.random.default_rng(4).normal(size=(2000, 3)) * spread(there)) < NORMAL_WIDTH * found.std
    assert 0.935 < inside.mean() < 0.965
    np.testing.assert_allclose(found.std / spread(there), (found.std / spread(there))[0, 0])


def test_without_standard_deviations_nothing_is_scaled():
    inputs, _ = made_inputs(30, seed=1)
    assert calibrated(lambda there: Prediction(np.zeros((len(there), 3))), [])(inputs).std is None
