"""A Gaussian process interpolates, and knows where it does not."""

import numpy as np
from made_remainders import NOISE_M, SMOOTH_M, made_inputs, smooth

from elastocal.remainder import gaussian_process
from elastocal.remainder.protocol import Inputs


def fitted(count=150, seed=1):
    inputs, residual = made_inputs(count, seed)
    return next(iter(gaussian_process.fitted(inputs, residual, gaussian_process.SETTINGS, 1)))


def test_what_is_smooth_is_predicted_within_the_noise_and_its_intervals_hold():
    there, _ = made_inputs(400, seed=2, width=1.3)
    found = fitted()(there)
    off = found.mean - smooth(there.joint_angles)
    assert np.sqrt((off**2).mean()) < NOISE_M
    measured = off + np.random.default_rng(3).normal(0.0, NOISE_M, off.shape)
    # 1,200 coordinates: the share inside has a standard error of 0.6 %.
    assert 0.92 < (np.abs(measured) < 1.96 * found.std).mean() < 0.98


def test_a_process_with_values_at_few_places_still_learns_from_all_observations(monkeypatch):
    """A quarter of the places: the error stays half of that of a process that knows these observations alone."""
    inputs, residual = made_inputs(400, seed=1)
    there, _ = made_inputs(300, seed=2, width=1.3)
    found = {}
    for most, count in ((400, 400), (40, 400), (40, 40)):
        monkeypatch.setattr(gaussian_process, "_MOST", most)
        some = np.arange(count)
        predictor = next(iter(gaussian_process.fitted(inputs.select(some), residual[some], gaussian_process.SETTINGS, 1)))
        found[most, count] = np.sqrt(((predictor(there).mean - smooth(there.joint_angles)) ** 2).mean())
    assert found[40, 400] < 0.5 * found[40, 40] and found[40, 400] < 3.0 * found[400, 400]


def test_intervals_grow_outside_the_data_up_to_the_size_of_the_residuals():
    near, far = (Inputs(np.full((1, 2), angle), np.zeros((1, 3)), np.zeros((1, 3, 3))) for angle in (0.0, 40.0))
    predictor = fitted()
    within, beyond = predictor(near), predictor(far)
    assert (beyond.std > 5 * within.std).all()
    # There it says the mean of the residuals, and that it may be wrong by all that they vary.
    assert (beyond.std > 0.5 * SMOOTH_M).all() and (np.abs(beyond.mean) < SMOOTH_M).all()
