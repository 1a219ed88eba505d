"""Rows that no model explains: their distances are those of a fit without them, and
their number is that of chance."""

from dataclasses import replace

import numpy as np
import pytest
from bad_rows import damaged
from made_folders import PLAN, made_folder, made_table
from scipy.stats import binom, chi2

from elastocal.diagnosis.gross_errors import (
    beyond_chance,
    entries_of,
    first_kept,
    fitted_to,
    gross_errors,
)
from elastocal.diagnosis.settings import Settings
from elastocal.fitting.least_squares import fit_model
from elastocal.fitting.model import get_parameter_values
from elastocal.loop.whole import cases_in

SETTINGS = Settings()
NOISE_M = 6e-5
BAD = 11


def test_the_distance_of_a_row_is_that_from_a_fit_without_it(cases):
    case, _ = cases
    measurements = case.campaign.measurements
    every = np.ones(len(measurements), bool)
    whole = fitted_to(case, every, SETTINGS)
    without = fitted_to(case, np.arange(len(measurements)) != BAD, SETTINGS)
    found = []
    for part in (whole, without):
        found.append(
            gross_errors(
                part.declared, whole.noise, measurements, part.kept, SETTINGS
            ).distance
        )
    # Weights of the robust fit differ a little, since the model lacks something.
    assert found[0][BAD] == pytest.approx(found[1][BAD], rel=0.1)


def test_rows_stand_out_by_chance_as_often_as_the_settings_say():
    rows = 40
    count = 3000
    draws = np.random.default_rng(0)
    distance = np.sqrt(draws.chisquare(3, (count, rows)))
    alarms = sum(
        beyond_chance(each, 3, np.ones(rows, bool), SETTINGS)[1].any()
        for each in distance
    )
    # A rate twice that of the settings would exceed this in all but 1e-6 of such tests.
    assert alarms <= binom.ppf(0.999, count, SETTINGS.gross_error_level)


def test_a_model_that_does_not_fit_makes_no_row_stand_out():
    distance = 30.0 * np.sqrt(np.random.default_rng(1).chisquare(3, 60))
    scaled, gross = beyond_chance(distance, 3, np.ones(60, bool), SETTINGS)
    assert not gross.any() and np.median(scaled) == pytest.approx(
        np.sqrt(chi2.median(3)), rel=0.2
    )
    distance[:3] *= 20.0
    assert np.flatnonzero(
        beyond_chance(distance, 3, np.ones(60, bool), SETTINGS)[1]
    ).tolist() == [0, 1, 2]


def test_where_too_many_rows_stand_out_none_is_a_gross_error():
    distance = np.ones(40)
    distance[:9] = 1e3
    assert not beyond_chance(distance, 3, np.ones(40, bool), SETTINGS)[1].any()


def test_sentences_say_what_a_row_reads(cases, diagnosis):
    case = damaged(cases[0], {})
    position = case.campaign.measurements.position
    position[4], position[8] = 0.0, position[7]
    measurements = case.campaign.measurements
    every = np.ones(len(position), bool)
    errors = gross_errors(
        diagnosis.final, diagnosis.declared.noise, measurements, every, SETTINGS
    )
    told = {
        entry["rows"][0]: entry["detail"]
        for entry in entries_of(errors, case.campaign, held_out=False)
    }
    assert "reads 0, 0, 0" in told[measurements.row[4]]
    assert (
        f"the same point as line {measurements.row[7] + 1} of"
        in told[measurements.row[8]]
    )


SETTINGS = Settings()
BAD = 11


def test_a_search_looks_at_the_same_poses_whatever_rows_are_left_out_or_come_back(
    cases,
):
    case = cases[0]
    settings = replace(SETTINGS, searched_observations=12)
    pose = case.campaign.measurements.pose
    whole = fitted_to(case, pose >= 0, settings).searched
    assert 2 < len(whole) < len(case.observations)
    for out in (
        whole.states.pose[:1],
        whole.states.pose[-2:],
        np.setdiff1d(pose, whole.states.pose),
    ):
        some = fitted_to(case, ~np.isin(pose, out), settings).searched
        np.testing.assert_array_equal(
            some.position, whole.position[~np.isin(whole.states.pose, out)[whole.state]]
        )


def test_the_last_step_to_all_of_a_long_campaign_leaves_a_tenth_of_a_standard_error_at_most(
    cases, monkeypatch
):
    part = fitted_to(
        cases[0],
        cases[0].campaign.measurements.pose >= 0,
        replace(SETTINGS, searched_observations=24),
    )
    usual = part.to_all(part.declared)
    for module in ("fitting.least_squares", "diagnosis.gross_errors"):
        monkeypatch.setattr(f"elastocal.{module}.LARGE_FIT_SIZE", 30)
    monkeypatch.setattr("elastocal.fitting.least_squares._STEPPING_STONE", 36)
    long = part.to_all(part.declared)
    off, exact = (
        get_parameter_values(each.model, each.estimate)
        for each in (long, fit_model(usual.model, part.case.observations, usual.noise))
    )
    assert (off != get_parameter_values(usual.model, usual.estimate)).any()
    assert (np.abs(off - exact) <= 0.1 * np.sqrt(np.diag(usual.covariance))).all()


@pytest.fixture
def case(cases):
    return cases[0]


@pytest.mark.parametrize(
    "shifts", [{BAD: 0.02}, {BAD: 0.02, 3: -0.1}, {0: 1e3, 5: 1.0, 20: 0.03}]
)
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
    kept = first_kept(
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
        not first_kept(damaged(case, dict.fromkeys(repeated, 2.0)), SETTINGS)
        .kept[repeated]
        .any()
    )


@pytest.mark.parametrize("error_rad", [3e-4, 1e-3])
def test_no_row_is_a_gross_error_where_all_measurements_of_a_pose_err_together(
    error_rad, kuka, config_folder, tmp_path
):
    table = made_table(kuka, "made", plan=replace(PLAN, poses=40))
    drawn = error_rad * np.random.default_rng(0).standard_normal(
        (max(table["pose"]) + 1, 6)
    )
    table |= {
        f"q{joint}": table[f"q{joint}"] + drawn[table["pose"], joint - 1]
        for joint in range(1, 7)
    }
    whole, _ = cases_in(
        made_folder(tmp_path / "made", kuka, table=table), config_folder / "robots"
    )
    assert first_kept(whole, SETTINGS).kept.all()
