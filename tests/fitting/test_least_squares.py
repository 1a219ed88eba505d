"""Fits: known parameters come back, and errors are those of statsmodels and of repetition."""

from dataclasses import replace

import numpy as np
import pytest
import statsmodels.api as sm
from fitted_models import (
    GANTRY_NOISES,
    TARGETS,
    gantry_covariance,
    gantry_model,
    gantry_states,
    linear_law,
    model_of,
    names_held,
    seen_off,
    waves,
)
from scipy.linalg import block_diag
from synthetic import NOISE, made_estimate, made_states, seen_exactly

from elastocal.fitting.least_squares import fit, fit_frames


def assert_covariance(found, expected, atol):
    """Covariances agree in units of the standard errors, which are returned."""
    deviation = np.sqrt(np.diag(expected))
    unit = np.outer(deviation, deviation)
    np.testing.assert_allclose(found.covariance / unit, expected / unit, rtol=0, atol=atol)
    return deviation


@pytest.mark.parametrize("rows", [3, 6])
@pytest.mark.parametrize(
    "keys",
    [
        (),
        ("joint_offset@2", "joint_offset@3", "joint_offset@5"),
        ("link_weight@3", "compensator_torque@2", "transmission_ratio@4"),
        ("base_compliance[rocking]", "joint_tilt@3", "stiffening@2"),
        ("lost_motion@2",),
        ("hysteresis@2", "frame_drift", "thermal_growth[temperature]"),
    ],
    ids=lambda keys: "+".join(keys) or "frames alone",
)
def test_noiseless_measurements_give_back_every_parameter(fanuc, keys, rows):
    model = model_of(fanuc, *keys, targets=TARGETS, rows=rows)
    true, states = made_estimate(model, (0, 1), seed=1), made_states(6, 40, seed=2, sessions=2)
    # Loads as large as such an arm carries, with which the measurements show where the laws of a gear bend.
    states.wrench[:] *= 1.5
    found = fit(model, seen_exactly(model, true, states), NOISE)
    assert names_held(found) == []
    np.testing.assert_allclose(found.residual, 0.0, atol=1e-9)
    for owner in ("frame_position", "target_offset", "frame_rotation", "target_rotation"):
        np.testing.assert_allclose(getattr(found.estimate, owner), getattr(true, owner), rtol=0, atol=1e-8)
    deviation = np.sqrt(np.diag(found.covariance))
    order = [i for i, (owner, _) in enumerate(found.parameters) if not owner.startswith(("frame ", "target "))]
    values = [
        np.concatenate([*(part for pair in zip(e.coefficients, e.shapes, strict=True) for part in pair), []])
        for e in (found.estimate, true)
    ]
    # The last step is a thousandth of a standard error at most; the next one would be its square.
    assert (np.abs(values[0] - values[1]) <= 1e-4 * deviation[order] + 1e-12 * np.abs(values[1])).all()
    assert (found.weights == 1.0).all()


PRIORS = [None, None, 2e-5, 1e-3, 5e-6]


def linear_problem(noise, count=40, priors=PRIORS):
    """Observations of a linear law, none so far off that it loses weight; their design, data and covariance."""
    model, states = gantry_model(linear_law(len(priors), priors)), gantry_states(count, 16)
    sigma = gantry_covariance(states, noise)
    rng = np.random.default_rng(93)
    errors = np.linalg.cholesky(sigma) @ rng.uniform(-1.0, 1.0, 3 * count)
    left = waves(states.joint_angles, len(priors)).reshape(3 * count, -1)
    right = left @ rng.normal(0, 3e-5, len(priors)) + errors
    return model, seen_off(states, right.reshape(-1, 3)), left, right, sigma


def generalized_least_squares(left, right, sigma, priors):
    """Estimate and covariance by statsmodels, each prior as one more measurement of zero."""
    known = [n for n, prior in enumerate(priors) if prior is not None]
    rows = np.concatenate([left, np.eye(len(priors))[known]])
    whole = block_diag(sigma, *(np.array([[priors[n] ** 2]]) for n in known))
    found = sm.GLS(np.concatenate([right, np.zeros(len(known))]), rows, sigma=whole).fit()
    return found.params, found.normalized_cov_params


@pytest.mark.parametrize("start", ["nothing", "the data alone", "far away"])
@pytest.mark.parametrize("kind", GANTRY_NOISES)
def test_a_linear_problem_has_the_generalized_least_squares_solution_with_its_priors(kind, start):
    """Wherever the fit starts, the estimate that the data prefer without the priors among them."""
    noise = GANTRY_NOISES[kind]
    model, seen, left, right, sigma = linear_problem(noise)
    expected, covariance = generalized_least_squares(left, right, sigma, PRIORS)
    alone, _ = generalized_least_squares(left, right, sigma, [None] * 5)
    deviation = np.sqrt(np.diag(covariance))
    # Data and priors both count, or it would be no test of either.
    assert (np.abs(alone - expected) > deviation).any()
    nothing = made_estimate(model, size=0.0)
    begin = {"nothing": None, "the data alone": replace(nothing, coefficients=(alone,))}
    begin["far away"] = replace(nothing, coefficients=(np.array([1e-2, -1e-2, 5e-3, 0.0, -5e-3]),))
    found = fit(model, seen, noise, begin[start])
    assert found.converged and not found.held.any() and (found.weights == 1.0).all()
    np.testing.assert_allclose(found.estimate.coefficients[0] / deviation, expected / deviation, rtol=0, atol=1e-5)
    assert_covariance(found, covariance, 1e-7)
    np.testing.assert_allclose(found.residual.ravel(), right - left @ expected, rtol=0, atol=1e-5 * noise.position_m)


@pytest.mark.parametrize("plausible", [1e-8, 1.0])
def test_what_has_a_prior_is_determined_by_it_where_the_data_do_not_and_nothing_else_is(plausible):
    """However small its plausible size: its prior says how large it may be. Without a prior it is held at zero."""
    priors = [None, None, None, 3e-6]
    noise = GANTRY_NOISES["sensor"]
    states = gantry_states(40)
    right = np.random.default_rng(94).uniform(-1e-4, 1e-4, (40, 3)) / np.sqrt(states.repeats)[:, None]
    expected, covariance = generalized_least_squares(
        waves(states.joint_angles, 4).reshape(120, -1), right.ravel(), gantry_covariance(states, noise), priors
    )
    # The data would tell it to a few times its prior.
    assert 0.5 < np.sqrt(covariance[3, 3]) / 3e-6 < 1.0
    law = linear_law(4, priors)
    last = replace(law.parameters[3], plausible=plausible)
    found = fit(gantry_model(replace(law, parameters=(*law.parameters[:3], last))), seen_off(states, right), noise)
    deviation = np.sqrt(np.diag(covariance))
    assert not found.held.any()
    np.testing.assert_allclose(found.estimate.coefficients[0] / deviation, expected / deviation, rtol=0, atol=1e-5)
    np.testing.assert_allclose(np.sqrt(np.diag(found.covariance)), deviation, rtol=1e-6)
    without = replace(law, parameters=(*law.parameters[:3], replace(last, prior_std=None)))
    freed = fit(gantry_model(without), seen_off(states, right), noise)
    assert freed.held.tolist() == [False, False, False, plausible < 1e-6]
    assert (freed.estimate.coefficients[0][3] == 0.0) == (plausible < 1e-6)


def test_a_fit_to_more_than_it_starts_from_is_that_to_all_of_them(monkeypatch):
    noise = GANTRY_NOISES["joints"]
    model, seen, left, right, sigma = linear_problem(noise, 60)
    expected, covariance = generalized_least_squares(left, right, sigma, PRIORS)
    monkeypatch.setattr("elastocal.fitting.least_squares.STARTED_FROM", 20)
    found = fit(model, seen, noise)
    deviation = np.sqrt(np.diag(covariance))
    assert found.converged and len(found.residual) == 60
    np.testing.assert_allclose(found.estimate.coefficients[0] / deviation, expected / deviation, rtol=0, atol=1e-5)


@pytest.mark.parametrize("rows", [3, 6])
def test_frames_are_fitted_to_targets_that_stay_as_they_were_found(fanuc, rows):
    """Exact measurements of the same targets from elsewhere give back the frame; others have their own."""
    model = model_of(fanuc, "joint_offset@3", "lost_motion@2", targets=TARGETS, rows=rows)
    true = made_estimate(model, seed=36)
    fitted = fit(model, seen_exactly(model, true, made_states(6, 40, seed=37)), NOISE)
    elsewhere = replace(made_estimate(model, seed=38), coefficients=true.coefficients, shapes=true.shapes)
    here = replace(elsewhere, target_offset=true.target_offset, target_rotation=true.target_rotation)
    states = made_states(6, 10, seed=39)
    found = fit_frames(fitted, model, seen_exactly(model, here, states), own_targets=False)
    for name in ("target_offset", "target_rotation"):
        np.testing.assert_array_equal(getattr(found, name), getattr(fitted.estimate, name))
    np.testing.assert_allclose(found.frame_position, here.frame_position, rtol=0, atol=1e-7)
    np.testing.assert_allclose(found.frame_rotation, here.frame_rotation, rtol=0, atol=1e-7)
    others = fit_frames(fitted, model, seen_exactly(model, elsewhere, states))
    for name in ("frame_position", "target_offset"):
        np.testing.assert_allclose(getattr(others, name), getattr(elsewhere, name), rtol=0, atol=1e-7)
    for each in (found, others):
        for ours, theirs in zip(each.coefficients, fitted.estimate.coefficients, strict=True):
            np.testing.assert_array_equal(ours, theirs)
