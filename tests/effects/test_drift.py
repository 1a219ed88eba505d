"""A set-up that was moved is found; by how much a robot is warmer."""

from dataclasses import replace

import numpy as np
import pytest
from synthetic import NOISE, candidate_on, made_estimate, made_model, made_states, seen_exactly, with_noise

from elastocal.fitting.least_squares import fit

# Between two of the values that are tried, nearer to the second.
SPACING, WHEN = 1 / 12, 0.655


def test_moved_setup_is_found_without_a_clock(fanuc):
    """A step of 0.3 mm in the middle of 40 measurements is fitted where it is, and leaves a misfit where it is not.

    Of the values that are tried the nearest is as good as the true one but for the measurement between them.
    """
    candidate = candidate_on(fanuc.chain, "setup_step")
    model = made_model(fanuc.chain, compliance=fanuc.compliance, effects=(candidate,))
    true = replace(made_estimate(model, seed=17), coefficients=(np.array([3e-4, 0, 0, 0, 0, 0]),), shapes=(np.array([WHEN]),))
    states = replace(made_states(6, 40, seed=18), time_s=None)
    seen = with_noise(seen_exactly(model, true, states), np.random.default_rng(19), position_m=20e-6)
    noise = replace(NOISE, position_m=20e-6)
    misfit = []
    for when in candidate.shapes[0].values(3):
        start = replace(true, coefficients=(np.zeros(6),), shapes=(np.array([when]),))
        found = fit(model, seen, noise, start)
        misfit.append((found.whitened(found.residual) ** 2).sum())
        if abs(when - WHEN) < SPACING / 2:
            deviation = np.sqrt(found.covariance[-7, -7])
            assert abs(found.estimate.coefficients[0][0] - 3e-4) < 4 * deviation < 1e-4
    best = candidate.shapes[0].values(3)[int(np.argmin(misfit))]
    assert abs(best - WHEN) < SPACING / 2 and np.median(misfit) > min(misfit) + 100


@pytest.mark.parametrize("effect", ["thermal_growth", "temperature_gradient"])
def test_each_cause_needs_its_covariate_and_only_the_time_has_a_lag(effect, fanuc):
    where = {"thermal_growth": "[{}]", "temperature_gradient": "@2[{}]"}[effect]
    by_temperature, by_time = (candidate_on(fanuc.chain, effect + where.format(cause)) for cause in ("temperature", "time"))
    assert (by_temperature.needs, by_time.needs, by_temperature.shapes) == ({"temperature"}, {"time"}, ())
    (lag,) = by_time.shapes
    assert lag.unit == "s" and lag.lowest == 15 * 60 and lag.highest == 10 * 3600 and lag.start == 3600
