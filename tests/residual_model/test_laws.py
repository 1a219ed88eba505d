"""Formulas of regressions give their means."""

import numpy as np
import pytest
from made_remainders import made_inputs

from elastocal.residual_model.laws import DisplacementLaw, ProcessLaw
from elastocal.residual_model.regressions import REGRESSIONS

SETTINGS = {
    "ridge_harmonics": {"orders": 3, "penalty": 1e-2},
    "two_joints": {},
    "gaussian_process": {},
}


def evaluate(law, inputs):
    """Mean of a regression at inputs by its formula, (M, 3)."""
    if isinstance(law, ProcessLaw):
        scaled = (inputs.columns[:, law.columns] - law.center) / law.spread
        apart = (scaled / law.lengths)[:, None] - law.points
        root = np.sqrt(5.0 * (apart**2).sum(axis=2))
        kernel = (1.0 + root + root**2 / 3.0) * np.exp(-root)
        return law.offset + law.size * (kernel @ law.weights)
    mean = inputs.jacobian @ law.geometry
    for term in law.terms:
        phase = sum(order * inputs.joint_angles[:, j] for j, order in term.orders)
        wave = getattr(np, term.wave)(phase + np.zeros(len(inputs)))
        mean += term.value * wave[:, None] * inputs.jacobian[..., term.coordinate]
    return mean


@pytest.mark.parametrize("name", SETTINGS)
def test_a_formula_gives_the_mean_of_its_regression(name):
    inputs, residual = made_inputs(60, seed=3, joints=3)
    predictor = next(REGRESSIONS[name].fit(inputs, residual, [SETTINGS[name]], 1))
    queries, _ = made_inputs(30, seed=4, joints=3)
    mean = predictor.mean(queries)
    assert np.abs(mean).max() > 1e-6
    np.testing.assert_allclose(evaluate(predictor.law, queries), mean, atol=1e-13)
    shrunk = evaluate(predictor.law.scaled(0.5), queries)
    np.testing.assert_allclose(shrunk, 0.5 * mean, atol=1e-13)


def test_geometry_and_harmonics_are_apart():
    inputs, residual = made_inputs(60, seed=3, joints=3)
    setting = SETTINGS["ridge_harmonics"]
    predictor = next(REGRESSIONS["ridge_harmonics"].fit(inputs, residual, [setting], 1))
    assert isinstance(predictor.law, DisplacementLaw)
    assert len(predictor.law.geometry) == inputs.jacobian.shape[2]
    assert len(predictor.law.terms) == 2 * 3 * 3
