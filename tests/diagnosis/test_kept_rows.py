"""Which rows are fitted, before anything is known of what the model lacks."""

from dataclasses import replace

import numpy as np
import pytest
from bad_rows import damaged

from elastocal.diagnosis.kept_rows import first_kept
from elastocal.diagnosis.settings import Settings

SETTINGS, BAD = Settings(), 11


@pytest.fixture
def case(cases):
    return cases[0]


@pytest.mark.parametrize("shifts", [{BAD: 0.02}, {BAD: 0.02, 3: -0.1}, {0: 1e3, 5: 1.0, 20: 0.03}])
def test_rows_are_found_beside_an_effect_that_the_model_lacks(case, shifts):
    kept = first_kept(damaged(case, shifts), SETTINGS).kept
    # A bad repeat takes the others of its state along, until a model says which it is.
    assert not kept[list(shifts)].any() and (~kept).sum() <= 2 * len(shifts)


@pytest.mark.parametrize("times", [-4.0, 30.0, 300.0])
def test_loads_that_pull_the_fit_to_themselves_are_found_together(case, times):
    measurements = case.campaign.measurements
    bad = np.flatnonzero(measurements.wrench.any(axis=1))[[1, 6, 9]]
    wrench = measurements.wrench.copy()
    wrench[bad] *= times
    campaign = replace(case.campaign, measurements=replace(measurements, wrench=wrench))
    kept = first_kept(replace(case, campaign=campaign).select(np.ones(len(wrench), bool)), SETTINGS).kept
    assert not kept[bad].any()


def test_a_repeat_that_is_in_no_average_stays_out(case):
    measurements = case.campaign.measurements
    state = list(zip(measurements.pose, measurements.load, measurements.target, strict=True))
    repeated = [place for place, key in enumerate(state) if state.count(key) > 2][:1]
    assert not first_kept(damaged(case, dict.fromkeys(repeated, 2.0)), SETTINGS).kept[repeated].any()
