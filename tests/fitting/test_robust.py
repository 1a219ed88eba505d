"""Robust steps: outliers do little harm, and fits converge to a minimum of their objective."""

from dataclasses import replace

import numpy as np
import pytest
import statsmodels.api as sm
from fitted_models import bent, model_of
from scipy.stats import chi2
from synthetic import NOISE, made_estimate, made_states, seen_exactly, with_noise

from elastocal.campaigns.campaign import Target
from elastocal.fitting.displacement import conditions
from elastocal.fitting.least_squares import fit
from elastocal.fitting.linearization import linearize
from elastocal.fitting.noise import Noise
from elastocal.fitting.parameters import stepped
from elastocal.fitting.prediction import residuals


def robust_objective(found):
    """Huber's, of all observations of a fit without a prior, by the library's own norm."""
    rows = found.model.rows
    norm = sm.robust.norms.HuberT(np.sqrt(chi2.ppf(0.99, rows) / rows))
    return rows * norm.rho(np.sqrt((found.whitener.apply(found.residual) ** 2).mean(axis=1))).sum()


def test_outliers_get_little_weight_and_do_little_harm(fanuc):
    model = model_of(fanuc, "joint_offset@3")
    true = made_estimate(model, seed=24)
    clean = with_noise(seen_exactly(model, true, made_states(6, 60, seed=25)), np.random.default_rng(26))
    moved = clean.position.copy()
    moved[[3, 20, 41]] += [[0.02, 0, 0], [0, -0.02, 0], [0.01, 0.01, 0.01]]
    found = fit(model, replace(clean, position=moved), NOISE)
    before = fit(model, clean, NOISE)
    assert (found.weights[[3, 20, 41]] < 0.02).all()
    assert np.median(np.delete(found.weights, [3, 20, 41])) == 1.0
    deviation = np.sqrt(before.covariance[-1, -1])
    shift = np.abs(found.estimate.coefficients[0] - before.estimate.coefficients[0])
    assert shift < 2 * deviation
    # Without weights the three would have moved it by far more.
    line = linearize(model, before.estimate, clean, conditions(model, before.estimate, clean.states))
    pulled = before.covariance @ np.einsum("mrp,mr->p", line.sensitivities, moved - clean.position) / NOISE.position_m**2
    assert np.abs(pulled[-1]) > 3 * shift


@pytest.mark.parametrize(("seed", "lag"), [(3, 1500.0), (24, 900.0), (25, 1500.0), (11, 20000.0)])
def test_steps_that_do_not_help_are_halved_until_the_fit_converges(fanuc, seed, lag, monkeypatch):
    model, seen = bent(fanuc, seed, lag)
    found = fit(model, seen, NOISE)
    assert found.converged
    monkeypatch.setattr("elastocal.fitting.robust._HALVINGS", 0)
    whole = fit(model, seen, NOISE)
    assert not whole.converged
    assert robust_objective(found) < robust_objective(whole) - 0.01


def test_fit_that_converged_is_at_a_minimum_of_its_objective(fanuc):
    model, seen = bent(fanuc, 3, 1500.0)
    found = fit(model, seen, NOISE)
    deviation = np.sqrt(np.diag(found.covariance))
    for number, size in enumerate(deviation):
        for sign in (-0.1, 0.1):
            moved = stepped(model, found.estimate, sign * size * np.eye(len(deviation))[number])
            residual = residuals(model, moved, seen, conditions(model, moved, seen.states))
            assert robust_objective(replace(found, residual=residual)) > robust_objective(found)


@pytest.mark.parametrize(("seed", "lag", "end"), [(4, 8000.0, 36000.0), (8, 3000.0, 900.0)])
def test_fit_converges_at_the_end_of_the_range_of_a_shape(fanuc, seed, lag, end):
    model, seen = bent(fanuc, seed, lag)
    found = fit(model, seen, NOISE)
    assert found.converged and found.estimate.shapes[0][0] == end
    # The others are where they are best given that end: held there they do not move.
    frozen = replace(model.effects[0], shapes=(), displacement=lambda around: model.effects[0].displacement(around, end))
    without = replace(model, effects=(frozen,))
    start = replace(found.estimate, shapes=(np.zeros(0),))
    again = fit(without, seen, NOISE, start)
    deviation = np.sqrt(again.covariance[-1, -1])
    assert abs(again.estimate.coefficients[0][0] - found.estimate.coefficients[0][0]) < 2e-3 * deviation


def test_outliers_lose_weight_from_the_first_step_of_a_fit_that_starts_from_another_one(fanuc):
    """One that starts where it ends stays there, in one step."""
    model = model_of(fanuc, "joint_offset@3")
    clean = with_noise(
        seen_exactly(model, made_estimate(model, seed=24), made_states(6, 60, seed=25)), np.random.default_rng(26)
    )
    moved = clean.position.copy()
    moved[[3, 20, 41]] += 0.02
    seen = replace(clean, position=moved)
    found = fit(model, seen, NOISE)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("elastocal.fitting.robust._STEPS", 1)
        again = fit(model, seen, NOISE, found.estimate, reweighted=True)
        anew = fit(model, seen, NOISE, found.estimate)
    deviation = np.sqrt(found.covariance[-1, -1])
    off = [abs(each.estimate.coefficients[0][0] - found.estimate.coefficients[0][0]) / deviation for each in (again, anew)]
    assert again.converged and off[0] < 2e-3
    assert not anew.converged and off[1] > 0.1


def test_fit_says_when_it_ran_out_of_steps(fanuc, monkeypatch):
    model, seen = bent(fanuc, 3, 1500.0)
    monkeypatch.setattr("elastocal.fitting.robust._STEPS", 3)
    assert not fit(model, seen, NOISE).converged


def test_ordinary_fits_converge(fanuc):
    model = model_of(fanuc, "joint_offset@3", "link_weight@2", "hysteresis@4")
    seen = with_noise(
        seen_exactly(model, made_estimate(model, seed=61), made_states(6, 30, seed=62)), np.random.default_rng(63)
    )
    assert fit(model, seen, NOISE).converged


@pytest.mark.parametrize("rows", [3, 6])
@pytest.mark.parametrize("seed", range(6))
def test_fit_converges_where_measurements_share_an_error_and_the_model_misses_far_more_than_the_noise(fanuc, seed, rows):
    """As on a real robot with a good tracker: three reflectors, joints that repeat badly, a law of gravity that is left out."""
    targets = tuple(Target(name, "6DoF", None) for name in "ABC")
    true = model_of(fanuc, "joint_offset@2", "joint_offset@3", "link_geometry@3", "link_weight@2", targets=targets, rows=rows)
    states = replace(made_states(6, 24, seed=(70, seed)), repeats=np.full(24, 10))
    estimate = made_estimate(true, seed=seed, size=1.0)
    seen = with_noise(seen_exactly(true, estimate, states), np.random.default_rng((71, seed)), 20e-6, 20e-6)
    model = replace(true, effects=true.effects[:-1])
    noise = Noise("declared", 6e-6, 6e-6, 1e-6 * np.array([40.0, 15, 15, 1, 45, 220]))
    found = fit(model, seen, noise)
    # In standard deviations.
    assert np.sqrt((found.whitener.apply(found.residual) ** 2).mean()) > 5.0
    assert found.converged
    again = fit(model, seen, noise, found.estimate)
    moved = np.concatenate(again.estimate.coefficients) - np.concatenate(found.estimate.coefficients)
    deviation = np.sqrt(np.diag(again.covariance))[-len(moved) :]
    assert (np.abs(moved) <= 0.1 * deviation).all()
