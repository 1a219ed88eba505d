"""Expectations in closed form, against simulated estimates."""

import numpy as np
import pytest
from made_study_blocks import judge

from elastocal.study.expectations import expected_compliance, expected_deviation
from elastocal.study.metrics import error_forms, mean_deviation, position_errors

DRAWS = 200_000


def test_the_averaged_stiffness_has_the_bias_of_second_order():
    """Monte Carlo error 2e-5; what is left out is 3 (s/c)^4, 3e-5 here."""
    true, relative = np.array([0.5e-6, 2e-6]), np.array([0.02, 0.05])
    drawn = true * (1 + relative * np.random.default_rng(1).standard_normal((DRAWS, 2)))
    found = expected_compliance(true, (relative * true) ** 2, "stiffness")
    np.testing.assert_allclose(found, 1 / (1 / drawn).mean(axis=0), rtol=3e-4)
    assert (found < true).all()


@pytest.mark.parametrize("method", ["compliance", "median"])
def test_means_and_medians_of_compliances_have_none(method):
    true = np.array([0.5e-6, 2e-6])
    np.testing.assert_array_equal(expected_compliance(true, true**2, method), true)


@pytest.mark.parametrize("bias", [0.0, 0.01, 0.3])
def test_the_expected_deviation_is_the_mean_over_normal_models(kuka, bias):
    """With the bias far below the scatter, alike and far above; 4,000 draws have an error of 1 %."""
    scores = judge(kuka)
    rng = np.random.default_rng(2)
    root = 0.02 * kuka.compliance[:, None] * rng.standard_normal((6, 6))
    mean = kuka.compliance * (1 + bias)
    models = mean + rng.standard_normal((4000, 6)) @ root.T
    found = expected_deviation(scores, mean[None], (root @ root.T)[None])
    assert found[0] == pytest.approx(mean_deviation(scores, models[None]).mean(), rel=0.03)


def test_forms_give_the_squared_error_of_each_test_configuration(kuka):
    scores, model = judge(kuka), 1.2 * kuka.compliance
    whole = np.append(model - scores.reference, 1.0)
    np.testing.assert_allclose((error_forms(scores) @ whole) @ whole, position_errors(scores, model[None])[0] ** 2, rtol=1e-9)
