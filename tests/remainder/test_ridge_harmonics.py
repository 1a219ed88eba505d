"""Harmonics by ridge regression, beside what scikit-learn makes of the same columns."""

import numpy as np
import pytest
from made_remainders import made_inputs
from sklearn.linear_model import Ridge

from elastocal.remainder import ridge_harmonics


def columns(inputs, orders):
    """Columns written down anew: the Jacobian, and that of a joint times sine and cosine of its angle's multiples."""
    found = [inputs.jacobian[:, :, j] for j in range(3)]
    for order in range(1, orders + 1):
        for wave in (np.sin, np.cos):
            found += [inputs.jacobian[:, :, j] * wave(order * inputs.joint_angles[:, [j]]) for j in range(2)]
    return np.stack(found, axis=-1)


def deviating(inputs, orders=3, seed=4):
    waves = columns(inputs, orders)
    return waves @ np.random.default_rng(seed).normal(0.0, 1e-4, waves.shape[-1])


def test_harmonics_and_geometry_without_noise_are_found_exactly():
    (inputs, _), (there, _) = made_inputs(80, seed=1), made_inputs(30, seed=2)
    found = next(ridge_harmonics.fitted(inputs, deviating(inputs), [{"orders": 3, "penalty": 1e-12}], 1))
    np.testing.assert_allclose(found(there).mean, deviating(there), atol=1e-10)


@pytest.mark.parametrize("orders", [1, 4])
def test_the_penalty_is_that_of_ridge_regression_and_settings_do_not_mix(orders):
    (inputs, residual), (there, _) = made_inputs(80, seed=1), made_inputs(30, seed=2)
    waves, penalty = columns(inputs, orders).reshape(240, -1), 0.3
    alone = Ridge(alpha=penalty * (waves**2).sum(axis=0).mean(), fit_intercept=False).fit(waves, residual.ravel())
    settings = [{"orders": each, "penalty": other} for each, other in ((orders, 3.0), (orders, penalty), (6, penalty))]
    found = list(ridge_harmonics.fitted(inputs, residual, settings, 1))[1](there).mean
    np.testing.assert_allclose(found.ravel(), columns(there, orders).reshape(90, -1) @ alone.coef_, rtol=1e-8, atol=1e-12)
