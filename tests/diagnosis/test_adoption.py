"""Effects enter the model only if the evidence and groups of left-out training poses
together let the squared errors of new poses fall."""

import numpy as np
import pytest
from planted import planted

from elastocal.diagnosis import adoption
from elastocal.diagnosis.adoption import (
    choose_kept_fit,
    describe_losses,
    describe_missing_gain,
)
from elastocal.diagnosis.model_averaging import PredictedGain
from elastocal.diagnosis.settings import Settings
from elastocal.fitting.least_squares import fit_model

SETTINGS = Settings()
KEY = "joint_offset@3"
STRONG = PredictedGain(share=0.95, std_error=0.2, squares=100.0)
WEAK = PredictedGain(share=0.1, std_error=1.0, squares=4.0)


def fit_effects(campaign, keys):
    """Fit the declared model without and with effects of the catalogue."""
    candidates = [campaign.candidates[key] for key in keys]
    model = campaign.declared.model.with_effects(candidates)
    noise = campaign.declared.noise
    return campaign.declared, fit_model(model, campaign.observations, noise)


def test_an_effect_that_acts_is_adopted(kuka):
    campaign = planted(kuka, {KEY: [5e-4]}, seed=2, poses=20)
    models = fit_effects(campaign, [KEY])
    for predicted in (STRONG, WEAK):
        sentences = describe_missing_gain(
            models, campaign.observations, predicted, SETTINGS
        )
        assert sentences == []


@pytest.mark.parametrize("seed", range(2))
def test_effects_that_only_fit_noise_are_not_adopted(seed, kuka):
    """Each of many parameters costs something in every group."""
    campaign = planted(kuka, {}, seed=seed, poses=20)
    keys = [
        f"{name}@{joint}"
        for name in ("joint_tilt", "link_geometry")
        for joint in (2, 3, 4)
    ]
    models = fit_effects(campaign, keys)
    (sentence,) = describe_missing_gain(models, campaign.observations, WEAK, SETTINGS)
    assert "20 groups of neighbouring training poses" in sentence
    assert "stays as declared" in sentence


def test_the_fit_that_predicts_left_out_poses_better_is_kept(kuka):
    campaign = planted(kuka, {KEY: [5e-4]}, seed=2, poses=20)
    poor, good = fit_effects(campaign, [KEY])
    for fits in ((poor, good), (good, poor)):
        assert choose_kept_fit(fits, campaign.observations, SETTINGS) is good


def test_of_fits_that_predict_alike_the_one_with_fewer_parameters_is_kept(kuka):
    """A robot without the effect is predicted alike with it and without."""
    campaign = planted(kuka, {}, seed=2, poses=20)
    simple, flexible = fit_effects(campaign, [KEY])
    for fits in ((simple, flexible), (flexible, simple)):
        assert choose_kept_fit(fits, campaign.observations, SETTINGS) is simple


def make_gains(mean, std_error, groups=10):
    """Gains of groups with a given mean and standard error of the mean."""
    deviations = np.linspace(-1.0, 1.0, groups)
    return mean + deviations / deviations.std(ddof=1) * np.sqrt(groups) * std_error


def expect_share(measured, std_error, predicted, groups=10):
    """Expected gain, in units of the squares that the effects add (here 1e-8 m2)."""
    size = 1e-8
    gains = size * make_gains(measured, std_error, groups)
    return adoption._expect_gain(gains, size, predicted, SETTINGS) / size


@pytest.mark.parametrize("groups", [4, 10])
@pytest.mark.parametrize("measured", [-3.0, -0.5, 0.2, 2.0])
def test_the_expected_gain_is_the_mean_of_prior_draws_weighted_by_their_likelihood(
    measured, groups
):
    """With 400,000 draws the standard error of such a mean is below 0.005."""
    draws = np.random.default_rng(3)
    count = 400_000
    std_error = 0.6
    is_useless = draws.random(count) < SETTINGS.useless_prediction
    normal = draws.standard_normal(count)
    useless = std_error * np.sqrt(groups) * normal
    gain = np.where(is_useless, useless, STRONG.share + STRONG.std_error * normal)
    ratio = (measured - gain) / std_error
    weights = (1.0 + ratio**2 / (groups - 1)) ** (-0.5 * groups)
    expected = (weights @ gain) / weights.sum()
    computed = expect_share(measured, std_error, STRONG, groups)
    assert computed == pytest.approx(expected, abs=0.02)


def test_strong_evidence_decides_where_few_poses_measure_the_gain_poorly():
    assert expect_share(-0.5, 1.5, STRONG) > 0.3
    assert expect_share(-0.5, 1.5, WEAK) < 0.0


def test_poses_that_measure_a_loss_well_decide_against_any_evidence():
    certain = PredictedGain(share=1.0, std_error=0.05, squares=1600.0)
    for predicted in (STRONG, certain):
        assert expect_share(-0.2, 0.05, predicted) == pytest.approx(-0.2, abs=0.03)


def test_poses_that_measure_a_gain_well_decide_without_evidence():
    assert expect_share(0.05, 0.01, WEAK) == pytest.approx(0.05, abs=0.006)


def test_a_loss_far_beyond_what_was_predicted_is_no_accident():
    assert expect_share(-1e4, 300.0, STRONG) < 0.0


# Factors of the left-out residuals with the effects: of positions and of orientations.
@pytest.mark.parametrize(
    ("factors", "is_adopted"),
    [((0.5, 0.5), True), ((2.0, 0.01), False), ((0.9, 30.0), False)],
)
def test_both_positions_and_measurements_must_be_expected_to_get_better(
    factors, is_adopted, kuka, monkeypatch
):
    campaign = planted(kuka, {KEY: [5e-4]}, seed=2, poses=20)
    models = fit_effects(campaign, [KEY])

    def predict_residuals(fitted, observations, group):
        residual = np.full((len(observations), 6), 1e-3)
        residual *= 1.0 + 0.01 * group[:, None]
        if fitted is models[1]:
            residual *= np.repeat(factors, 3)
        return residual

    monkeypatch.setattr(adoption, "predict_left_out_residuals", predict_residuals)
    sentences = describe_missing_gain(models, campaign.observations, STRONG, SETTINGS)
    assert (not sentences) == is_adopted


def test_equal_models_gain_nothing(kuka):
    campaign = planted(kuka, {}, seed=1, poses=20)
    declared = campaign.declared
    (sentence,) = describe_missing_gain(
        (declared, declared), campaign.observations, STRONG, SETTINGS
    )
    assert "not expected to improve predictions of new poses" in sentence


def test_a_model_with_enough_measurements_is_not_compared_with_frames_alone(
    kuka, monkeypatch
):
    campaign = planted(kuka, {}, seed=1, poses=20)
    monkeypatch.setattr(adoption, "predict_left_out_residuals", None)
    settings = Settings(numbers_a_parameter=0.0)
    declared = campaign.declared
    assert not describe_losses(declared, [declared], campaign.observations, settings)
