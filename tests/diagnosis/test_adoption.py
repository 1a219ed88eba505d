"""Effects enter the model only if groups of left-out training poses are predicted
better."""

import pytest
from planted import planted

from elastocal.diagnosis import adoption
from elastocal.diagnosis.adoption import describe_losses, describe_missing_gain
from elastocal.diagnosis.settings import Settings
from elastocal.fitting.least_squares import fit_model

SETTINGS = Settings()
KEY = "joint_offset@3"


def fit_effect(campaign, key):
    """Fit the declared model with one effect of the catalogue."""
    model = campaign.declared.model.with_effects([campaign.candidates[key]])
    return fit_model(model, campaign.observations, campaign.declared.noise)


def test_an_effect_that_acts_is_adopted(kuka):
    campaign = planted(kuka, {KEY: [5e-4]}, seed=2, poses=20)
    full_model = fit_effect(campaign, KEY)
    sentences = describe_missing_gain(
        campaign.declared, full_model, campaign.observations, SETTINGS
    )
    assert sentences == []


@pytest.mark.parametrize("seed", range(4))
def test_an_effect_that_does_not_act_is_not_adopted(seed, kuka):
    """By chance alone a gain exceeds its standard error in one of six such campaigns,
    and less often here, because the parameter costs something in every group."""
    campaign = planted(kuka, {}, seed=seed, poses=20)
    full_model = fit_effect(campaign, "link_elasticity@3")
    (sentence,) = describe_missing_gain(
        campaign.declared, full_model, campaign.observations, SETTINGS
    )
    assert "10 groups of neighbouring training poses" in sentence
    assert "stays as declared" in sentence


# Gains in standard errors: of positions, and of positions and orientations in units of
# the noise.
@pytest.mark.parametrize(
    ("gains", "words"),
    [
        ((3.0, 3.0), None),
        ((-0.8, 3.0), None),
        ((-1.2, 3.0), "predicts positions worse"),
        ((3.0, 0.8), "does not predict measurements better"),
        ((0.0, 0.0), "does not predict measurements better"),
    ],
)
def test_measurements_must_get_better_and_positions_not_worse(
    gains, words, kuka, monkeypatch
):
    campaign = planted(kuka, {}, seed=1, poses=20)
    counted = iter([gains[1], gains[0]])
    monkeypatch.setattr(adoption, "_count_std_errors", lambda *_: next(counted))
    sentences = describe_missing_gain(
        campaign.declared, campaign.declared, campaign.observations, SETTINGS
    )
    assert bool(sentences) == bool(words)
    assert all(words in sentence for sentence in sentences)


def test_equal_models_gain_nothing(kuka):
    campaign = planted(kuka, {}, seed=1, poses=20)
    declared = campaign.declared
    (sentence,) = describe_missing_gain(
        declared, declared, campaign.observations, SETTINGS
    )
    assert "does not predict" in sentence


def test_a_model_with_enough_measurements_is_not_compared_with_frames_alone(
    kuka, monkeypatch
):
    campaign = planted(kuka, {}, seed=1, poses=20)
    monkeypatch.setattr(adoption, "predict_left_out_residuals", None)
    settings = Settings(numbers_a_parameter=0.0)
    declared = campaign.declared
    assert not describe_losses(declared, [declared], campaign.observations, settings)
