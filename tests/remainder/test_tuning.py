"""Settings are chosen by poses that a fit has not seen."""

import numpy as np
import pytest
from made_remainders import made_inputs

from elastocal.remainder import gaussian_process, ridge_harmonics
from elastocal.remainder.protocol import Part
from elastocal.remainder.tuning import no_correction, tuned


def parts(inputs, residual, count=4):
    fold = np.arange(len(inputs)) % count
    for number in range(count):
        rest, judged = fold != number, fold == number
        yield Part(inputs.select(rest), residual[rest], inputs.select(judged), residual[judged])


def test_the_orders_that_are_there_are_chosen():
    inputs, _ = made_inputs(200, seed=1)
    harmonic = inputs.jacobian[:, :, 0] * 1e-3 * np.sin(5 * inputs.joint_angles[:, [0]])
    found = tuned(ridge_harmonics, parts(inputs, harmonic), inputs, harmonic, 1)
    assert found.setting["orders"] >= 5
    there, _ = made_inputs(50, seed=2)
    expected = there.jacobian[:, :, 0] * 1e-3 * np.sin(5 * there.joint_angles[:, [0]])
    np.testing.assert_allclose(found.predictor(there).mean, expected, atol=5e-5)


def test_where_nothing_helps_nothing_is_corrected():
    """Of 20 data sets of noise, a correction is chosen in some by chance: that which is chosen must be small."""
    sizes = []
    for seed in range(20):
        inputs, _ = made_inputs(40, seed)
        noise = np.random.default_rng(100 + seed).normal(0.0, 1e-4, (40, 3))
        found = tuned(ridge_harmonics, parts(inputs, noise), inputs, noise, 1)
        assert (found.setting is None) == (found.predictor is no_correction)
        sizes.append(np.sqrt((found.predictor(inputs).mean ** 2).mean()))
    assert np.median(sizes) < 3e-5


def test_a_regression_with_one_setting_asks_for_no_folds():
    inputs, residual = made_inputs(30, seed=1)

    def never():
        pytest.fail("folds were made")
        yield

    assert tuned(gaussian_process, never(), inputs, residual, 1).setting == {}
