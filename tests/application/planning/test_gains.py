"""What planning is worth, and that fits to simulated measurements agree with the linear model."""

import pytest
from made_surveys import OPEN, PULL, made_survey

from elastocal.application.planning import gains as module
from elastocal.application.planning.gains import gains


@pytest.mark.slow
def test_it_takes_more_random_poses_and_fits_agree_with_the_prediction(monkeypatch):
    monkeypatch.setattr(module, "_ROBOTS", 4)
    monkeypatch.setattr(module, "_ORDERS", 20)
    found = gains(made_survey(), OPEN, PULL, 18, 600, 1)
    assert found["random_poses_low"] > 18
    assert found["planned_mm"] < found["random_mm"]
    assert found["fitted_planned_mm"] == pytest.approx(found["planned_mm"], rel=0.35)
    # A plan for the file is nearly as good on robots that are off it; one made for each of them can hardly be worse.
    assert 0.97 < found["robust_efficiency_least"] <= found["robust_efficiency"] < 1.005
    assert found["fitted_ratio_low"] <= found["fitted_ratio"] <= found["fitted_ratio_high"]
