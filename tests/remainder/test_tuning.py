"""Settings are chosen by poses that a fit has not seen, and intervals hold what they claim, whatever a regression states."""

from types import SimpleNamespace

import numpy as np
import pytest
from made_remainders import made_inputs

from elastocal.remainder import extra_trees, gaussian_process, ridge_harmonics
from elastocal.remainder.protocol import Part, Prediction
from elastocal.remainder.tuning import NORMAL_WIDTH, calibrated, no_correction, tuned


def parts(inputs, residual, count=4):
    fold = np.arange(len(inputs)) % count
    for number in range(count):
        rest, judged = fold != number, fold == number
        yield Part(inputs.select(rest), residual[rest], inputs.select(judged), residual[judged])


def test_the_orders_that_are_there_are_chosen():
    inputs, _ = made_inputs(200, seed=1)
    harmonic = inputs.jacobian[:, :, 0] * 1e-3 * np.sin(5 * inputs.joint_angles[:, [0]])
    found = tuned([ridge_harmonics], parts(inputs, harmonic), inputs, harmonic, 1)
    assert found.setting["orders"] >= 5
    there, _ = made_inputs(50, seed=2)
    expected = there.jacobian[:, :, 0] * 1e-3 * np.sin(5 * there.joint_angles[:, [0]])
    np.testing.assert_allclose(found.predictor(there).mean, expected, atol=5e-5)


def test_where_nothing_helps_nothing_is_corrected():
    """Of 8 data sets of noise, a correction is chosen in some by chance: that which is chosen must be small."""
    sizes = []
    for seed in range(8):
        inputs, _ = made_inputs(40, seed)
        noise = np.random.default_rng(100 + seed).normal(0.0, 1e-4, (40, 3))
        found = tuned([ridge_harmonics], parts(inputs, noise), inputs, noise, 1)
        assert (found.setting is None) == (found.predictor is no_correction)
        sizes.append(np.sqrt((found.predictor(inputs).mean ** 2).mean()))
    assert np.median(sizes) < 3e-5


def test_of_several_regressions_the_one_that_predicts_left_out_poses_best_is_chosen():
    """Two trends are smooth; what jumps at a place is not, and no wave."""
    every = [extra_trees, gaussian_process, ridge_harmonics]
    inputs, smooth = made_inputs(70, seed=1)
    jumps = np.where(inputs.joint_angles[:, [0]] > 0.37, 3e-4, -3e-4) * np.where(inputs.joint_angles[:, [1]] > -0.2, 1.0, 0.2)
    jumps = jumps + np.random.default_rng(3).normal(0.0, 2e-5, (70, 3))
    assert [tuned(every, parts(inputs, off), inputs, off, 1).regression for off in (smooth, jumps)] == [
        gaussian_process,
        extra_trees,
    ]


def test_a_gain_within_its_standard_error_is_none():
    """One fold of four gains, the others lose a little."""

    def fitted(inputs, residual, settings, seed):
        yield lambda there: Prediction(np.full((len(there), 3), 1e-4))

    regression = SimpleNamespace(NAME="made", SETTINGS=({},), fitted=fitted)
    inputs, _ = made_inputs(40, seed=1)
    for worth, chosen in ((9e-5, regression), (4.9e-5, None)):
        residual = np.full((40, 3), worth)
        residual[::4] = 2e-4
        assert tuned([regression], parts(inputs, residual), inputs, residual, 1).regression is chosen


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
