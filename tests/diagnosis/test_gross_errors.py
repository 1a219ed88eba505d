"""Rows that no model explains: their distances are those of a fit without them, and
their number is that of chance."""

import numpy as np
import pytest
from bad_rows import damaged
from scipy.stats import binom, chi2

from elastocal.diagnosis.fitted_subset import fit_subset
from elastocal.diagnosis.gross_errors import (
    describe_gross_errors,
    find_gross_errors,
    flag_outliers,
)
from elastocal.diagnosis.settings import Settings

SETTINGS = Settings()
NOISE_M = 6e-5
BAD = 11


def test_the_distance_of_a_row_is_that_from_a_fit_without_it(cases):
    case, _ = cases
    measurements = case.campaign.measurements
    every = np.ones(len(measurements), bool)
    whole = fit_subset(case, every, SETTINGS)
    without = fit_subset(case, np.arange(len(measurements)) != BAD, SETTINGS)
    found = []
    for part in (whole, without):
        found.append(
            find_gross_errors(
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
        flag_outliers(each, 3, np.ones(rows, bool), SETTINGS)[1].any()
        for each in distance
    )
    # A rate twice that of the settings would exceed this in all but 1e-6 of such tests.
    assert alarms <= binom.ppf(0.999, count, SETTINGS.gross_error_level)


def test_a_model_that_does_not_fit_makes_no_row_stand_out():
    distance = 30.0 * np.sqrt(np.random.default_rng(1).chisquare(3, 60))
    scaled, gross = flag_outliers(distance, 3, np.ones(60, bool), SETTINGS)
    assert not gross.any() and np.median(scaled) == pytest.approx(
        np.sqrt(chi2.median(3)), rel=0.2
    )
    distance[:3] *= 20.0
    assert np.flatnonzero(
        flag_outliers(distance, 3, np.ones(60, bool), SETTINGS)[1]
    ).tolist() == [0, 1, 2]


def test_where_too_many_rows_stand_out_none_is_a_gross_error():
    distance = np.ones(40)
    distance[:9] = 1e3
    assert not flag_outliers(distance, 3, np.ones(40, bool), SETTINGS)[1].any()


def test_sentences_say_what_a_row_reads(cases, diagnosis):
    case = damaged(cases[0], {})
    position = case.campaign.measurements.position
    position[4], position[8] = 0.0, position[7]
    measurements = case.campaign.measurements
    every = np.ones(len(position), bool)
    errors = find_gross_errors(
        diagnosis.final, diagnosis.declared.noise, measurements, every, SETTINGS
    )
    told = {
        entry["rows"][0]: entry["detail"]
        for entry in describe_gross_errors(errors, case.campaign, held_out=False)
    }
    assert "reads 0, 0, 0" in told[measurements.row[4]]
    assert (
        f"the same point as line {measurements.row[7] + 1} of"
        in told[measurements.row[8]]
    )


SETTINGS = Settings()
BAD = 11
