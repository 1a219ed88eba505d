"""Settings are chosen by poses that a fit has not seen, the choice is judged by others, and intervals hold what they claim."""

from types import SimpleNamespace

import numpy as np
import pytest
from made_remainders import made_inputs

from elastocal.remainder import extra_trees, gaussian_process, ridge_harmonics
from elastocal.remainder.protocol import Folds, Prediction
from elastocal.remainder.tuning import NORMAL_WIDTH, gain_of, shrunk, spread_of, tuned


def folds(inputs, residual, count=5):
    """Every observation a configuration of its own, and a model that none of them moves."""
    number = np.arange(len(inputs))
    return Folds(inputs, number, number % count, residual, np.stack([residual] * count))


def chosen_of(regressions, inputs, residual):
    return tuned(regressions, folds(inputs, residual), inputs, residual, 1)


def test_the_orders_that_are_there_are_chosen_and_kept_whole():
    inputs, _ = made_inputs(200, seed=1)
    harmonic = inputs.jacobian[:, :, 0] * 1e-3 * np.sin(5 * inputs.joint_angles[:, [0]])
    found = chosen_of([ridge_harmonics], inputs, harmonic)
    assert found.setting["orders"] >= 5 and found.gain.factor > 0.99
    there, _ = made_inputs(50, seed=2)
    expected = there.jacobian[:, :, 0] * 1e-3 * np.sin(5 * there.joint_angles[:, [0]])
    np.testing.assert_allclose(found.predictor(there).mean, expected, atol=5e-5)


@pytest.mark.parametrize("count", [14, 60])
def test_where_nothing_is_left_nothing_is_corrected(count):
    """Of 20 data sets of noise, a test at 5 % passes two or more with a probability of a quarter, four or more of 2 %."""
    passed = 0
    for seed in range(20):
        inputs, _ = made_inputs(count, seed)
        noise = np.random.default_rng(100 + seed).normal(0.0, 1e-4, (count, 3))
        found = chosen_of([ridge_harmonics], inputs, noise)
        assert found.level == (0.01 if count < 40 else 0.05)
        assert found.regression or not found.predictor(inputs).mean.any()
        passed += found.regression is not None
    assert passed <= 3


def test_too_few_configurations_choose_nothing():
    inputs, residual = made_inputs(9, seed=1)
    assert chosen_of([ridge_harmonics], inputs, residual).gain is None


def test_of_several_regressions_the_one_that_predicts_left_out_poses_best_is_chosen():
    """Two trends are smooth; what jumps at a place is not, and no wave."""
    every = [extra_trees, gaussian_process, ridge_harmonics]
    inputs, smooth = made_inputs(70, seed=1)
    jumps = np.where(inputs.joint_angles[:, [0]] > 0.37, 3e-4, -3e-4) * np.where(inputs.joint_angles[:, [1]] > -0.2, 1.0, 0.2)
    jumps = jumps + np.random.default_rng(3).normal(0.0, 2e-5, (70, 3))
    assert [chosen_of(every, inputs, off).regression for off in (smooth, jumps)] == [gaussian_process, extra_trees]


def test_the_choice_is_judged_by_folds_that_had_no_part_in_it():
    """A regression that knows a residual wherever it may look: as good as its own fold's, and worthless elsewhere."""

    def fitted(inputs, residual, settings, seed):
        known = {tuple(angles): off for angles, off in zip(inputs.joint_angles, residual, strict=True)}
        other = residual[::-1].mean(axis=0)
        yield lambda there: Prediction(np.array([known.get(tuple(angles), other) for angles in there.joint_angles]))

    inputs, _ = made_inputs(60, seed=1)
    noise = np.random.default_rng(2).normal(0.0, 1e-4, (60, 3))
    assert chosen_of([SimpleNamespace(SETTINGS=({},), fitted=fitted)], inputs, noise).regression is None


def test_a_gain_is_shrunk_and_its_test_allows_for_folds_that_share_their_poses():
    draws = np.random.default_rng(1)
    truth, noise = draws.normal(size=(400, 3)), draws.normal(size=(400, 3))
    predicted = 2.0 * truth
    gain = gain_of(((truth + noise) * predicted).sum(axis=1), (predicted**2).sum(axis=1), 400, 5)
    assert 0.45 < gain.factor < 0.55
    assert gain.rms_m == pytest.approx(np.sqrt(3.0), abs=2 * gain.rms_std_error_m)
    falls = gain.factor * (2 * (truth + noise) - gain.factor * predicted) * predicted
    t = falls.sum(axis=1).mean() / falls.sum(axis=1).std(ddof=1) * np.sqrt(400)
    assert gain.statistic == pytest.approx(t / np.sqrt(1 + 5 / 4), rel=1e-9)
    assert gain_of(-np.ones(20), np.ones(20), 20, 5).p_value == 1.0


def boasting(factor):
    """A regression that predicts zero and states a multiple of the noise, which grows with the first angle."""

    def fitted(inputs, residual, settings, seed):
        yield lambda there: Prediction(np.zeros((len(there), 3)), lambda: factor * spread(there))

    return SimpleNamespace(fitted=fitted)


def spread(there):
    return np.repeat(1e-4 * (1.0 + np.abs(there.joint_angles[:, :1])), 3, axis=1)


@pytest.mark.parametrize("factor", [0.1, 30.0])
def test_intervals_hold_95_percent_and_keep_their_shape(factor):
    inputs, _ = made_inputs(600, seed=1)
    off = np.random.default_rng(2).normal(size=(600, 3)) * spread(inputs)
    found = spread_of(np.abs(off), factor * spread(inputs))
    assert found.typical == pytest.approx(np.sqrt((off**2).mean()) / found.otherwise_m)
    honest = shrunk(boasting(factor), {}, 1.0, found, inputs, off, 1)
    there, _ = made_inputs(2000, seed=3)
    found = honest(there)
    # 1,800 scores and 6,000 coordinates: standard errors of 0.5 and 0.3 %.
    inside = np.abs(np.random.default_rng(4).normal(size=(2000, 3)) * spread(there)) < NORMAL_WIDTH * found.std
    assert 0.935 < inside.mean() < 0.965
    np.testing.assert_allclose(found.std / spread(there), (found.std / spread(there))[0, 0])


def test_a_regression_that_states_no_deviations_has_those_of_poses_left_out():
    inputs, residual = made_inputs(90, seed=1)
    found = chosen_of([extra_trees], inputs, residual)
    there, truth = made_inputs(2000, seed=3)
    prediction = found.predictor(there)
    assert found.spread.times is None and np.ptp(prediction.std) == 0.0
    assert (np.abs(truth - prediction.mean) < NORMAL_WIDTH * prediction.std).mean() > 0.9
