"""Effects that an analyst knows are scored, fitted and tested on their own."""

import numpy as np
import pytest
from planted import planted
from scipy.stats import norm

from elastocal_proof.blind.known_effects import (
    compute_wald_p_value,
    fit_scored_candidates,
    score_candidates,
)

OFFSET_RAD = 3e-4


def score(campaign, *keys):
    """Score the candidates with these keys."""
    candidates = [campaign.candidates[key] for key in keys]
    return score_candidates(campaign.declared, campaign.observations, candidates)


@pytest.fixture(scope="module")
def offset_campaign(kuka):
    return planted(kuka, {"joint_offset@3": OFFSET_RAD}, 1)


def test_the_true_effect_has_the_highest_score(offset_campaign):
    keys = [f"joint_offset@{joint}" for joint in range(2, 6)]
    scored = score(offset_campaign, *keys)
    assert max(scored, key=lambda key: scored[key].log_bayes_factor) == keys[1]
    assert scored[keys[1]].log_bayes_factor > 20.0


def test_without_candidates_there_are_no_scores(offset_campaign):
    assert score(offset_campaign) == {}


def test_priors_shrink_a_coefficient_towards_zero(offset_campaign):
    scored = score(offset_campaign, "joint_offset@3").values()
    declared, observations = offset_campaign.declared, offset_campaign.observations
    fits = [
        fit_scored_candidates(declared, observations, free, shrunk)
        for free, shrunk in ((scored, ()), ((), scored))
    ]
    [free, shrunk] = [fitted.effect_values("joint_offset@3")[0] for fitted in fits]
    assert 0.9 * abs(free) < abs(shrunk) < abs(free)


def test_the_fit_of_the_true_effect_has_its_size(offset_campaign):
    scored = score(offset_campaign, "joint_offset@3").values()
    fitted = fit_scored_candidates(
        offset_campaign.declared, offset_campaign.observations, scored
    )
    [value] = fitted.effect_values("joint_offset@3")[0]
    assert value == pytest.approx(OFFSET_RAD, rel=0.2)


def test_the_test_of_one_coefficient_is_that_of_its_standard_error(offset_campaign):
    scored = score(offset_campaign, "joint_offset@3").values()
    fitted = fit_scored_candidates(
        offset_campaign.declared, offset_campaign.observations, scored
    )
    [index] = fitted.parameter_indices("joint_offset@3")
    std_error = np.sqrt(fitted.covariance[index, index])
    [value] = fitted.effect_values("joint_offset@3")[0]
    expected = 2.0 * norm.sf(abs(value) / std_error)
    candidate = offset_campaign.candidates["joint_offset@3"]
    p_value = compute_wald_p_value(fitted, [candidate])
    assert p_value == pytest.approx(expected, rel=1e-6)
