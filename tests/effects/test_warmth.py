"""By how much a robot is warmer: above 20 degrees, or by the share of a first-order lag."""

from dataclasses import replace

import numpy as np
import pytest
from synthetic import conditions_on, made_states

from elastocal.effects.warmth import by_warmth


@pytest.fixture
def causes():
    """What a candidate of each cause is made of."""
    found = by_warmth(lambda cause, rise, needs, shapes: (cause, rise, needs, shapes))
    return {cause: (rise, needs, shapes) for cause, rise, needs, shapes in found}


def test_each_cause_needs_its_covariate_and_only_the_time_has_a_lag(causes):
    assert list(causes) == ["temperature", "time"]
    assert {cause: needs for cause, (_, needs, _) in causes.items()} == {"temperature": {"temperature"}, "time": {"time"}}
    assert causes["temperature"][2] == ()
    (lag,) = causes["time"][2]
    assert lag.unit == "s" and lag.lowest == 15 * 60 and lag.highest == 10 * 3600 and lag.start == 3600


@pytest.mark.parametrize("lag", [900.0, 3600.0, 36000.0])
def test_warmth_by_time_solves_the_equation_of_a_body_that_warms_up(lag, fanuc, causes):
    """lag dw/dt = 1 - w from w = 0: by central differences, and half of it after lag ln 2."""
    step = 1e-3 * lag
    times = np.array([0.0, lag * np.log(2), lag - step, lag, lag + step, 50 * lag])
    states = replace(made_states(6, 6), time_s=times)
    warm = causes["time"][0](conditions_on(fanuc.chain, states), lag)
    np.testing.assert_allclose(warm[[0, 1, 5]], [0.0, 0.5, 1.0], rtol=1e-12, atol=1e-15)
    assert lag * (warm[4] - warm[2]) / (2 * step) == pytest.approx(1 - warm[3], rel=1e-6)
