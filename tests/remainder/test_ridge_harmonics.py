"""Harmonics by ridge regression, beside what scikit-learn makes of the same columns."""

import numpy as np
import pytest
from made_remainders import made_inputs
from sklearn.linear_model import Ridge

from elastocal.remainder import ridge_harmonics


def columns(inputs, orders):
    """Columns written down anew: the Jacobian of a joint times sine and cosine of its angle's multiples."""
    found = []
    for order in range(1, orders + 1):
        for wave in (np.sin, np.cos):
            found += [inputs.jacobian[:, :, j] * wave(order * inputs.joint_angles[:, [j]]) for j in range(2)]
    return np.stack(found, axis=-1)


def deviating(inputs, orders=3, seed=4):
    draws = np.random.default_rng(seed)
    waves = columns(inputs, orders)
    return waves @ draws.normal(0.0, 1e-4, waves.shape[-1])


def predictor(inputs, residual, **setting):
    return next(iter(ridge_harmonics.fitted(inputs, residual, [setting], 1)))


def test_harmonics_without_noise_are_found_exactly():
    (inputs, _), (there, _) = made_inputs(80, seed=1), made_inputs(30, seed=2)
    found = predictor(inputs, deviating(inputs), orders=3, penalty=1e-12, geometry=False)
    np.testing.assert_allclose(found(there).mean, deviating(there), atol=1e-10)


@pytest.mark.parametrize("orders", [1, 4])
def test_the_penalty_is_that_of_ridge_regression(orders):
    (inputs, residual), (there, _) = made_inputs(80, seed=1), made_inputs(30, seed=2)
    waves = columns(inputs, orders).reshape(240, -1)
    penalty = 0.3
    alone = Ridge(alpha=penalty * (waves**2).sum(axis=0).mean(), fit_intercept=False).fit(waves, residual.ravel())
    expected = columns(there, orders).reshape(90, -1) @ alone.coef_
    found = predictor(inputs, residual, orders=orders, penalty=penalty, geometry=False)(there).mean
    np.testing.assert_allclose(found.ravel(), expected, rtol=1e-8, atol=1e-12)


def test_geometry_beside_the_harmonics_has_no_penalty():
    (inputs, _), (there, _) = made_inputs(80, seed=1), made_inputs(30, seed=2)
    shift = np.array([2e-4, -1e-4, 5e-4])
    residual = deviating(inputs) + inputs.jacobian @ shift
    found = predictor(inputs, residual, orders=3, penalty=1e-10, geometry=True)
    np.testing.assert_allclose(found(there).mean, deviating(there) + there.jacobian @ shift, atol=1e-9)
    # With a penalty that leaves no harmonics, geometry is fitted as if alone.
    heavy = predictor(inputs, residual, orders=3, penalty=1e9, geometry=True)
    rows = inputs.jacobian.reshape(240, -1)
    alone = np.linalg.lstsq(rows, residual.ravel())[0]
    np.testing.assert_allclose(heavy(there).mean, there.jacobian @ alone, atol=1e-9)


def test_settings_share_their_sums_without_mixing():
    inputs, residual = made_inputs(60, seed=3)
    settings = [ridge_harmonics.SETTINGS[number] for number in (0, 40, 100)]
    together = [each(inputs).mean for each in ridge_harmonics.fitted(inputs, residual, settings, 1)]
    for setting, found in zip(settings, together, strict=True):
        np.testing.assert_allclose(predictor(inputs, residual, **setting)(inputs).mean, found, atol=1e-12)
