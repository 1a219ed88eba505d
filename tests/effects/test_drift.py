"""By how much a robot is warmer: above 20 degrees, or by the share of a first-order lag."""

import pytest
from synthetic import candidate_on


@pytest.mark.parametrize("effect", ["thermal_growth", "temperature_gradient"])
def test_each_cause_needs_its_covariate_and_only_the_time_has_a_lag(effect, fanuc):
    where = {"thermal_growth": "[{}]", "temperature_gradient": "@2[{}]"}[effect]
    by_temperature, by_time = (candidate_on(fanuc.chain, effect + where.format(cause)) for cause in ("temperature", "time"))
    assert (by_temperature.needs, by_time.needs, by_temperature.shapes) == ({"temperature"}, {"time"}, ())
    (lag,) = by_time.shapes
    assert lag.unit == "s" and lag.lowest == 15 * 60 and lag.highest == 10 * 3600 and lag.start == 3600
