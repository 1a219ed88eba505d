"""The part of a case that is fitted."""

from dataclasses import replace

import numpy as np
import pytest
from bad_rows import damaged

from elastocal.diagnosis.fitted_subset import fit_subset, select_initial_subset
from elastocal.diagnosis.settings import Settings
from elastocal.fitting.least_squares import fit_model
from elastocal.fitting.model import get_parameter_values

SETTINGS = Settings()
NOISE_M = 6e-5
BAD = 11


@pytest.fixture
def case(cases):
    return cases[0]


def test_a_search_looks_at_the_same_poses_whatever_rows_are_left_out_or_come_back(
    cases,
):
    case = cases[0]
    settings = replace(SETTINGS, searched_observations=12)
    pose = case.campaign.measurements.pose
    whole = fit_subset(case, pose >= 0, settings).search_sample
    assert 2 < len(whole) < len(case.observations)
    for out in (
        whole.states.pose[:1],
        whole.states.pose[-2:],
        np.setdiff1d(pose, whole.states.pose),
    ):
        some = fit_subset(case, ~np.isin(pose, out), settings).search_sample
        np.testing.assert_array_equal(
            some.position, whole.position[~np.isin(whole.states.pose, out)[whole.state]]
        )


def test_the_last_step_to_all_of_a_long_campaign_leaves_a_tenth_of_a_standard_error_at_most(
    cases, monkeypatch
):
    part = fit_subset(
        cases[0],
        cases[0].campaign.measurements.pose >= 0,
        replace(SETTINGS, searched_observations=24),
    )
    usual = part.fit_to_all(part.declared)
    for module in ("fitting.least_squares", "diagnosis.fitted_subset"):
        monkeypatch.setattr(f"elastocal.{module}.LARGE_FIT_SIZE", 30)
    monkeypatch.setattr("elastocal.fitting.least_squares._STEPPING_STONE", 36)
    long = part.fit_to_all(part.declared)
    off, exact = (
        get_parameter_values(each.model, each.estimate)
        for each in (long, fit_model(usual.model, part.case.observations, usual.noise))
    )
    assert (off != get_parameter_values(usual.model, usual.estimate)).any()
    assert (np.abs(off - exact) <= 0.1 * np.sqrt(np.diag(usual.covariance))).all()


@pytest.mark.parametrize("times", [-4.0, 30.0, 300.0])
def test_loads_that_pull_the_fit_to_themselves_are_found_together(case, times):
    measurements = case.campaign.measurements
    bad = np.flatnonzero(measurements.wrench.any(axis=1))[[1, 6, 9]]
    wrench = measurements.wrench.copy()
    wrench[bad] *= times
    campaign = replace(case.campaign, measurements=replace(measurements, wrench=wrench))
    kept = select_initial_subset(
        replace(case, campaign=campaign).select(np.ones(len(wrench), bool)), SETTINGS
    ).kept
    assert not kept[bad].any()


def test_a_repeat_that_is_in_no_average_stays_out(case):
    measurements = case.campaign.measurements
    state = list(
        zip(measurements.pose, measurements.load, measurements.target, strict=True)
    )
    repeated = [place for place, key in enumerate(state) if state.count(key) > 2][:1]
    assert (
        not select_initial_subset(damaged(case, dict.fromkeys(repeated, 2.0)), SETTINGS)
        .kept[repeated]
        .any()
    )
