"""Robust steps: outliers do little harm, and fits converge to a minimum of their objective."""

from dataclasses import replace

import numpy as np
import pytest
import statsmodels.api as sm
from fitted_models import bent, gantry_model, gantry_states, linear_law, seen_off, waves
from scipy.optimize import minimize
from scipy.stats import chi2
from synthetic import NOISE, made_estimate

from elastocal.effects.protocol import Candidate, Parameter, Shape
from elastocal.fitting.least_squares import fit, robustly
from elastocal.fitting.noise import Noise
from elastocal.fitting.prediction import conditions


def robust_objective(found):
    """Huber's, of all observations of a fit without a prior, by the library's own norm."""
    rows = found.model.rows
    norm = sm.robust.norms.HuberT(np.sqrt(chi2.ppf(0.99, rows) / rows))
    return rows * norm.rho(np.sqrt((found.whitener.apply(found.residual) ** 2).mean(axis=1))).sum()


@pytest.mark.parametrize(("seed", "lag"), [(3, 1500.0), (24, 900.0), (25, 1500.0)])
def test_steps_that_do_not_help_are_halved_until_the_fit_converges(fanuc, seed, lag, monkeypatch):
    model, seen = bent(fanuc, seed, lag)
    found = fit(model, seen, NOISE)
    assert found.converged
    monkeypatch.setattr("elastocal.fitting.robust._HALVINGS", 0)
    whole = fit(model, seen, NOISE)
    assert not whole.converged
    assert robust_objective(found) < robust_objective(whole) - 0.01


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


PRIORS = [None, 3e-5, None]
SENSOR = Noise("declared", 1e-4, 5e-5, np.zeros(3))


def with_outliers(rows, count=40):
    """Observations of a linear law, of which five are far off; design (S, 3, 3) and what is off, in positions and turns."""
    rng = np.random.default_rng(95)
    states = replace(gantry_states(count), repeats=np.ones(count, int))
    left = waves(states.joint_angles, 3)
    off = 1e-4 * rng.standard_normal((count, 3)) + left @ [4e-5, -8e-5, 1e-4]
    off[[3, 11, 17, 30, 38]] += 1e-3 * np.array([[1, 0, 0], [0, -2, 0], [0, 0, 3], [2, 2, 0], [5, 0, 0]])
    turned = 5e-5 * rng.standard_normal((count, 3)) if rows == 6 else None
    model = gantry_model(linear_law(3, PRIORS), rows=rows)
    return model, seen_off(states, off, turned), left, off, turned


def distances(off, turned, left, values, factor):
    """Root mean square of what is left of each observation, in standard deviations of the noise taken."""
    parts = [(off - left @ values) / 1e-4] if turned is None else [(off - left @ values) / 1e-4, turned / 5e-5]
    return np.sqrt((np.concatenate(parts, axis=1) ** 2).mean(axis=1)) / factor


@pytest.mark.parametrize("rows", [3, 6])
def test_a_linear_problem_with_outliers_is_at_the_minimum_of_hubers_objective_with_its_priors(rows):
    """By a general minimiser: each observation counts as its squares up to the 99 % quantile of its distance."""
    model, seen, left, off, turned = with_outliers(rows)
    corner = np.sqrt(chi2.ppf(0.99, rows) / rows)

    def objective(scaled):
        far = distances(off, turned, left, 1e-5 * scaled, 2.0)
        huber = np.where(far <= corner, 0.5 * far**2, corner * far - 0.5 * corner**2)
        return rows * huber.sum() + 0.5 * (1e-5 * scaled[1] / PRIORS[1]) ** 2

    expected = minimize(objective, np.zeros(3), method="BFGS", options={"gtol": 1e-8}).x
    # Of a noise taken so large that its scale is not estimated from the measurements.
    found = fit(model, seen, SENSOR.scaled(2.0))
    deviation = np.sqrt(np.diag(found.covariance))
    assert found.converged and (found.weights < 1).sum() >= 4
    np.testing.assert_allclose(found.estimate.coefficients[0] / deviation, 1e-5 * expected / deviation, rtol=0, atol=5e-3)


@pytest.mark.parametrize("rows", [3, 6])
@pytest.mark.parametrize("taken", [0.2, 0.7, 1.0, 3.0])
def test_weights_fall_with_the_distance_by_the_scale_of_the_errors_that_are_there(rows, taken):
    """One up to the 99 % quantile, then its share; the scale is that of the median distance, but never below the noise."""
    model, seen, left, off, turned = with_outliers(rows)
    found = fit(model, seen, SENSOR.scaled(taken))
    far = distances(off, turned, left, found.estimate.coefficients[0], taken)
    scale = max(1.0, np.median(far) / np.sqrt(chi2.ppf(0.5, rows) / rows))
    assert (scale > 1.3) == (taken < 0.75)
    expected = np.minimum(1.0, np.sqrt(chi2.ppf(0.99, rows) / rows) * scale / far)
    assert found.converged and (expected < 1).sum() >= 3
    np.testing.assert_allclose(found.weights, expected, rtol=2e-3)
    # The estimate solves the equations of these weights, its covariance is their inverse.
    weighted = left.reshape(-1, 3) * np.repeat(found.weights, 3)[:, None] / (1e-4 * taken) ** 2
    precision = weighted.T @ left.reshape(-1, 3) + np.diag([0.0, PRIORS[1] ** -2, 0.0])
    values = np.linalg.solve(precision, weighted.T @ off.ravel())
    deviation = np.sqrt(np.diag(np.linalg.inv(precision)))
    np.testing.assert_allclose(found.estimate.coefficients[0] / deviation, values / deviation, rtol=0, atol=5e-3 * scale)
    np.testing.assert_allclose(np.sqrt(np.diag(found.covariance)), deviation, rtol=1e-6)


def one_parameter(spread):
    """A law of one parameter, observations whose errors are all of one size, in standard deviations; estimate and its error."""
    states = replace(gantry_states(30), repeats=np.ones(30, int))
    left = waves(states.joint_angles, 1)[..., 0]
    off = 1e-4 * spread * np.random.default_rng(96).choice([-1.0, 1.0], (30, 3))
    model = gantry_model(linear_law(1))
    best, deviation = (left * off).sum() / (left**2).sum(), 1e-4 / np.sqrt((left**2).sum())
    return model, seen_off(states, off), best, deviation


@pytest.mark.parametrize(("spread", "settled"), [(0.5, None), (5.0, None), (0.5, 0.1), (5.0, 0.1)])
@pytest.mark.parametrize(("share", "converged"), [(0.98, True), (-0.98, True), (1.02, False), (-1.02, False)])
def test_a_fit_has_converged_where_its_step_is_below_a_share_of_the_standard_error(
    spread, settled, share, converged, monkeypatch
):
    """A thousandth unless told otherwise; of measurements that scatter more than the noise, of their own standard error."""
    model, seen, best, deviation = one_parameter(spread)
    # All distances are alike but for what the one parameter takes: their median is their root mean square.
    scale = max(1.0, spread / np.sqrt(chi2.ppf(0.5, 3) / 3))
    options, largest = ({} if settled is None else {"settled": settled}), settled or 1e-3
    start = made_estimate(model, size=0.0)
    start = replace(start, coefficients=(np.array([best + share * largest * scale * deviation]),))
    monkeypatch.setattr("elastocal.fitting.robust._STEPS", 1)
    found = fit(model, seen, SENSOR, start, reweighted=True, **options)
    assert found.converged == converged
    # The last step is taken all the same: a linear problem is solved by it.
    assert found.estimate.coefficients[0][0] == pytest.approx(best, abs=1e-3 * largest * deviation)
    # One that starts anew gives all observations one weight first, and does not trust that step.
    assert not fit(model, seen, SENSOR, start, **options).converged


@pytest.mark.parametrize("frozen", [[True, False, False], [False, True, True]])
def test_frozen_parameters_stay_and_the_others_are_best_beside_them(frozen):
    model, seen, left, off, _ = with_outliers(3)
    start = replace(made_estimate(model, size=0.0), coefficients=(np.array([2e-4, -1e-4, 3e-4]),))
    found = robustly(model, seen, conditions(model, start, seen.states), SENSOR, start, np.array(frozen))
    values, free = found.estimate.coefficients[0], ~np.array(frozen)
    np.testing.assert_array_equal(values[frozen], start.coefficients[0][frozen])
    weighted = left.reshape(-1, 3) * np.repeat(found.weights, 3)[:, None] / 1e-8
    pull = weighted.T @ (off - left @ values).ravel() - values * np.array([0.0, PRIORS[1] ** -2, 0.0])
    assert (np.abs(np.linalg.solve(np.linalg.inv(found.covariance[np.ix_(free, free)]), pull[free])) < 1e-5).all()
    assert found.held.tolist() == frozen and not found.covariance[np.array(frozen)].any()


SATURATION = Shape("knee", "1", 0.5, 0.2, 3.0)


def saturating(around, knee):
    """A law that is taken up at a knee in the angle of joint 1, and another one that is partly like it."""
    angle = around.joint_angles[:, 0]
    return [{0: np.tanh(angle / knee)}, {0: beside(angle)}]


def beside(angle):
    return angle**2 + 0.5 * angle


def saturated(knee, count=60):
    """Observations of that law at a knee, which errors as large as the noise but of one size do not hide."""
    law = Candidate("made_law", "made", (1,), "", tuple(Parameter(n, "m", 0.1) for n in "ab"), saturating, shapes=(SATURATION,))
    states = replace(gantry_states(count), repeats=np.ones(count, int))
    angle = states.joint_angles[:, 0]
    off = 5e-5 * np.random.default_rng(97).choice([-1.0, 1.0], (count, 3))
    off[:, 0] += 5e-3 * max(knee, 1.0) * np.tanh(angle / knee) - 3e-4 * beside(angle)
    return gantry_model(law), seen_off(states, off), angle, off[:, 0]


@pytest.mark.parametrize("knee", [0.3, 1.0])
def test_a_shape_within_its_range_is_that_of_a_general_minimiser(knee):
    model, seen, angle, off = saturated(knee)
    found = fit(model, seen, SENSOR)

    def squares(values):
        return (((off - 1e-4 * values[0] * np.tanh(angle / values[2]) - 1e-4 * values[1] * beside(angle)) / 1e-4) ** 2).sum()

    expected = minimize(
        squares, [50.0, -3.0, knee], method="Nelder-Mead", options={"xatol": 1e-9, "fatol": 1e-12, "maxfev": 4000}
    ).x
    deviation = np.sqrt(np.diag(found.covariance))
    values = np.concatenate([found.estimate.coefficients[0], found.estimate.shapes[0]])
    assert found.converged and (found.weights == 1.0).all()
    np.testing.assert_allclose(values / deviation, expected * [1e-4, 1e-4, 1.0] / deviation, rtol=0, atol=2e-3)
    assert SATURATION.lowest < found.estimate.shapes[0][0] < SATURATION.highest
