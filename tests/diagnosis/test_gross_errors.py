"""Tests of the outlier test: good rows stand out as rarely as the settings say, and
sentences state what a gross error reads."""

from dataclasses import replace

import numpy as np
import pytest
from bad_rows import damaged
from scipy.stats import binom, chi2

from elastocal.diagnosis.gross_errors import (
    OutlierTest,
    describe_gross_errors,
    describe_standing_out,
    find_gross_errors,
    flag_outliers,
)
from elastocal.diagnosis.settings import Settings

SETTINGS = Settings()


def find_outliers(distance):
    """Scaled distances and outliers of three-dimensional rows that are all kept."""
    return flag_outliers(distance, 3, np.ones(len(distance), bool), SETTINGS)


def test_good_rows_stand_out_as_rarely_as_the_settings_say():
    campaigns = 3000
    generator = np.random.default_rng(0)
    distances = np.sqrt(generator.chisquare(3, (campaigns, 40)))
    false_alarms = sum(find_outliers(distance)[1].any() for distance in distances)
    # A rate twice that of the settings would exceed this in all but 1e-6 of such tests.
    limit = binom.ppf(0.999, campaigns, SETTINGS.gross_error_level)
    assert false_alarms <= limit


def test_a_model_with_a_systematic_misfit_makes_no_row_stand_out():
    distance = 30.0 * np.sqrt(np.random.default_rng(1).chisquare(3, 60))
    scaled, outlier = find_outliers(distance)
    assert not outlier.any()
    assert np.median(scaled) == pytest.approx(np.sqrt(chi2.median(3)), rel=0.2)
    distance[:3] *= 20.0
    _, outlier = find_outliers(distance)
    assert np.flatnonzero(outlier).tolist() == [0, 1, 2]


def test_if_too_many_rows_stand_out_none_is_a_gross_error():
    distance = np.ones(40)
    distance[:9] = 1e3
    assert not find_outliers(distance)[1].any()


def test_sentences_state_a_lost_beam_and_a_repeated_position(cases, diagnosis):
    campaign = damaged(cases[0], {}).campaign
    measurements = campaign.measurements
    position = measurements.position
    position[4] = 0.0
    position[8] = position[7]
    kept = np.ones(len(position), bool)
    noise = diagnosis.declared.noise
    outcome = find_gross_errors(diagnosis.final, noise, measurements, kept, SETTINGS)
    sentences = {
        error.rows[0]: error.detail
        for error in describe_gross_errors(outcome, campaign, held_out=False)
    }
    assert "reads 0, 0, 0" in sentences[measurements.row[4]]
    same_point = f"the same point as line {measurements.row[7] + 1} of"
    assert same_point in sentences[measurements.row[8]]


def test_a_sentence_states_a_probability_that_is_not_overwhelming(cases):
    campaign = cases[0].campaign
    count = len(campaign.measurements)
    outcome = replace(
        OutlierTest.none(count, 6),
        gross=np.arange(count) < 2,
        probability=np.linspace(1.0, 0.0, count) ** 5,
    )
    first, second = describe_gross_errors(outcome, campaign, held_out=False)
    assert first.probability == 1.0
    assert "probability" not in first.detail
    assert second.probability == outcome.probability[1]
    percent = f"{100 * second.probability:.0f} %"
    assert f"wrong with a probability of {percent}, left out" in second.detail


def test_rows_that_stay_far_from_the_model_are_described_from_two_poses_on(cases):
    campaign = cases[0].campaign
    pose = campaign.measurements.pose
    first, second = np.unique(pose)[:2]
    (sentence,) = describe_standing_out(np.isin(pose, [first, second]), campaign)
    assert "of 2 poses are far from the model and are kept" in sentence
    assert not describe_standing_out(pose == first, campaign)
    assert describe_standing_out(pose == first, campaign, least_poses=1)
