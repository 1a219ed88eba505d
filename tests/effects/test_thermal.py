"""By how much a robot is warmer: above 20 degrees, or by the share of a first-order lag."""

from dataclasses import replace

import numpy as np
import pytest
from synthetic import candidate_on, conditions_on, made_states

from elastocal.effects.thermal import warmer


@pytest.mark.parametrize("effect", ["thermal_growth", "temperature_gradient"])
def test_each_cause_needs_its_covariate_and_only_the_time_has_a_lag(effect, fanuc):
    where = {"thermal_growth": "[{}]", "temperature_gradient": "@2[{}]"}[effect]
    by_temperature, by_time = (candidate_on(fanuc.chain, effect + where.format(cause)) for cause in ("temperature", "time"))
    assert (by_temperature.needs, by_time.needs, by_temperature.shapes) == ({"temperature"}, {"time"}, ())
    (lag,) = by_time.shapes
    assert lag.unit == "s" and lag.lowest == 15 * 60 and lag.highest == 10 * 3600 and lag.start == 3600


@pytest.mark.parametrize("lag", [900.0, 3600.0, 36000.0])
def test_warmth_by_time_solves_the_equation_of_a_body_that_warms_up(lag, fanuc):
    """lag dw/dt = 1 - w from w = 0: by central differences, and half of it after lag ln 2."""
    step = 1e-3 * lag
    times = np.array([0.0, lag * np.log(2), lag - step, lag, lag + step, 50 * lag])
    states = replace(made_states(6, 6), time_s=times)
    warm = warmer(conditions_on(fanuc.chain, states), lag)
    np.testing.assert_allclose(warm[[0, 1, 5]], [0.0, 0.5, 1.0], rtol=1e-12, atol=1e-15)
    assert lag * (warm[4] - warm[2]) / (2 * step) == pytest.approx(1 - warm[3], rel=1e-6)
