"""Formulas of regressions give their means."""

import numpy as np
import pytest
from made_remainders import made_inputs

from elastocal.residual_model.laws import DisplacementLaw, ProcessLaw, TreesLaw
from elastocal.residual_model.regressions import REGRESSIONS

SETTINGS = {
    "ridge_harmonics": {"orders": 3, "penalty": 1e-2},
    "two_joints": {},
    "gaussian_process": {},
    "extra_trees": {"min_samples_split": 5, "max_features": 1.0},
}


def evaluate(law, inputs):
    """Mean of a regression at inputs by its formula, (M, 3)."""
    if isinstance(law, ProcessLaw):
        scaled = (inputs.columns[:, law.columns] - law.center) / law.spread
        apart = (scaled / law.lengths)[:, None] - law.points
        root = np.sqrt(5.0 * (apart**2).sum(axis=2))
        kernel = (1.0 + root + root**2 / 3.0) * np.exp(-root)
        return law.offset + law.size * (kernel @ law.weights)
    if isinstance(law, TreesLaw):
        return np.mean([find_leaves(tree, inputs) for tree in law.trees], axis=0)
    mean = inputs.jacobian @ law.geometry
    for term in law.terms:
        phase = sum(order * inputs.joint_angles[:, j] for j, order in term.orders)
        wave = getattr(np, term.wave)(phase + np.zeros(len(inputs)))
        mean += term.value * wave[:, None] * inputs.jacobian[..., term.coordinate]
    return mean


def find_leaves(tree, inputs):
    """Values of a tree at inputs, row by row."""
    values = []
    for row in inputs.columns.astype(np.float32):
        node = 0
        while tree.column[node] >= 0:
            is_beyond = row[tree.column[node]] > tree.threshold[node]
            node = tree.children[node, int(is_beyond)]
        values.append(tree.value[node])
    return np.array(values)


@pytest.mark.parametrize("name", SETTINGS)
def test_a_formula_gives_the_mean_of_its_regression(name):
    inputs, residual = made_inputs(60, seed=3, joints=3)
    predictor = next(REGRESSIONS[name].fit(inputs, residual, [SETTINGS[name]], 1))
    queries, _ = made_inputs(30, seed=4, joints=3)
    mean = predictor.mean(queries)
    assert np.abs(mean).max() > 1e-6
    law = predictor.law()
    np.testing.assert_allclose(evaluate(law, queries), mean, atol=1e-13)
    shrunk = evaluate(law.scaled(0.5), queries)
    np.testing.assert_allclose(shrunk, 0.5 * mean, atol=1e-13)


def test_geometry_and_harmonics_are_apart():
    inputs, residual = made_inputs(60, seed=3, joints=3)
    setting = SETTINGS["ridge_harmonics"]
    predictor = next(REGRESSIONS["ridge_harmonics"].fit(inputs, residual, [setting], 1))
    law = predictor.law()
    assert isinstance(law, DisplacementLaw)
    assert len(law.geometry) == inputs.jacobian.shape[2]
    assert len(law.terms) == 2 * 3 * 3
