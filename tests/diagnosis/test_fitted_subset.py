"""Tests of the part of a case that is fitted: which rows it has, which observations a
search uses, and how a fit to these becomes one to all."""

from dataclasses import replace

import numpy as np
import pytest
from bad_rows import damaged
from made_folders import PLAN, make_folder, make_table

from elastocal.diagnosis.fitted_subset import fit_subset, select_initial_subset
from elastocal.diagnosis.settings import Settings
from elastocal.fitting.least_squares import fit_model
from elastocal.fitting.model import get_parameter_values
from elastocal.loop.whole import read_cases

SETTINGS = Settings()


@pytest.fixture
def case(cases):
    return cases[0]


def test_a_search_uses_the_same_poses_whichever_rows_are_left_out(case):
    settings = replace(SETTINGS, searched_observations=12)
    pose = case.campaign.measurements.pose
    sample = fit_subset(case, pose >= 0, settings).search_sample
    assert 2 < len(sample) < len(case.observations)
    sampled_poses = sample.states.pose
    for left_out in (
        sampled_poses[:1],
        sampled_poses[-2:],
        np.setdiff1d(pose, sampled_poses),
    ):
        subset = fit_subset(case, ~np.isin(pose, left_out), settings)
        kept = ~np.isin(sampled_poses, left_out)[sample.state]
        np.testing.assert_array_equal(
            subset.search_sample.position, sample.position[kept]
        )


def test_the_last_step_of_a_long_campaign_leaves_at_most_a_tenth_of_a_standard_error(
    case, monkeypatch
):
    settings = replace(SETTINGS, searched_observations=24)
    subset = fit_subset(case, case.campaign.measurements.pose >= 0, settings)
    converged = subset.fit_to_all(subset.declared)
    for module in ("fitting.least_squares", "diagnosis.fitted_subset"):
        monkeypatch.setattr(f"elastocal.{module}.LARGE_FIT_SIZE", 30)
    monkeypatch.setattr("elastocal.fitting.least_squares._INTERMEDIATE_SAMPLE_SIZE", 36)
    one_step = subset.fit_to_all(subset.declared)
    exact = fit_model(converged.model, subset.case.observations, converged.noise)
    after_one_step, after_convergence, at_optimum = (
        get_parameter_values(fitted.model, fitted.estimate)
        for fitted in (one_step, converged, exact)
    )
    std_error = np.sqrt(np.diag(converged.covariance))
    assert (after_one_step != after_convergence).any()
    assert (np.abs(after_one_step - at_optimum) <= 0.1 * std_error).all()


@pytest.mark.parametrize("factor", [-4.0, 30.0, 300.0])
def test_rows_with_wrong_loads_that_pull_the_fit_are_left_out_together(case, factor):
    measurements = case.campaign.measurements
    bad_rows = np.flatnonzero(measurements.wrench.any(axis=1))[[1, 6, 9]]
    wrench = measurements.wrench.copy()
    wrench[bad_rows] *= factor
    campaign = replace(case.campaign, measurements=replace(measurements, wrench=wrench))
    with_wrong_loads = replace(case, campaign=campaign)
    every_row = np.ones(len(wrench), bool)
    subset = select_initial_subset(with_wrong_loads.select(every_row), SETTINGS)
    assert not subset.kept[bad_rows].any()


def test_an_outlying_repeat_that_no_average_contains_is_left_out(
    kuka, config_folder, tmp_path
):
    table = make_table(kuka, "made", plan=replace(PLAN, repeats=3, repeated_poses=4))
    folder = make_folder(tmp_path / "made", kuka, table=table)
    case, _ = read_cases(folder, config_folder / "robots")
    measurements = case.campaign.measurements
    states = list(
        zip(measurements.pose, measurements.load, measurements.target, strict=True)
    )
    row = next(row for row, state in enumerate(states) if states.count(state) > 2)
    subset = select_initial_subset(damaged(case, {row: 2.0}), SETTINGS)
    assert np.flatnonzero(~subset.kept).tolist() == [row]
