"""Lack of fit: as often rejected as its level says, and always where something large is missing."""

from dataclasses import replace

import numpy as np
import pytest
from planted import planted
from scipy.stats import binom, f, kstest

from elastocal.fitting import fit
from elastocal.lack_of_fit import LEVEL, lack_of_fit
from elastocal.noise import Noise

CAMPAIGNS = 30


def with_noise(fitted, **changes):
    return replace(fitted, noise=replace(fitted.noise, **changes))


@pytest.fixture(scope="module")
def nothing_missing(fanuc):
    return [planted(fanuc, {}, seed=200 + number, poses=12) for number in range(CAMPAIGNS)]


def test_p_values_are_uniform_where_nothing_is_missing(nothing_missing):
    """Against a noise that is known for certain; of a noise known less well the test knows less."""
    certain = [lack_of_fit(with_noise(c.declared, degrees_of_freedom=10**7), c.observations) for c in nothing_missing]
    assert kstest([one.p_value for one in certain], "uniform").pvalue > 0.01
    # The whole ratio, not its share of some larger number of rows.
    assert np.mean([one.ratio for one in certain]) == pytest.approx(
        1.0, abs=4 * np.sqrt(2 / certain[0].residual_freedom / CAMPAIGNS)
    )
    declared = [lack_of_fit(c.declared, c.observations) for c in nothing_missing]
    assert sum(one.rejected for one in declared) <= binom.ppf(0.99, CAMPAIGNS, LEVEL)
    assert all(0.02 < one.p_value < 0.98 for one in declared)


def test_a_planted_effect_is_lack_of_fit_and_the_fit_with_it_is_not(fanuc):
    campaign = planted(fanuc, {"joint_offset@3": [5e-4]}, seed=1)
    found = lack_of_fit(campaign.declared, campaign.observations)
    assert found.rejected and found.p_value < 1e-9
    assert found.ratio > 5 and found.excess == found.ratio - 1
    # The discrepancy that the fit made up for its weights is no excuse.
    assert campaign.declared.discrepancy_m > 0


def some_wild(campaign, seed, share=0.03, deviations=(6.0, 60.0)):
    """The campaign with single readings off, and its declared model fitted anew."""
    rng = np.random.default_rng((12, seed))
    position = campaign.observations.position.copy()
    wild = rng.permutation(len(position))[: round(share * len(position))]
    off = rng.standard_normal((len(wild), 3))
    size = campaign.declared.noise.position_m * rng.uniform(*deviations, (len(wild), 1))
    position[wild] += size * off / np.linalg.norm(off, axis=1, keepdims=True)
    seen = replace(campaign.observations, position=position)
    return fit(campaign.declared.model, seen, campaign.declared.noise, campaign.declared.estimate), seen


def test_single_wild_readings_are_no_lack_of_fit(fanuc):
    campaigns = [planted(fanuc, {}, seed=300 + seed, poses=30) for seed in range(8)]
    certain = [
        [lack_of_fit(with_noise(fitted, degrees_of_freedom=10**7), seen) for fitted, seen in pair]
        for pair in [((c.declared, c.observations), some_wild(c, seed)) for seed, c in enumerate(campaigns)]
    ]
    for clean, found in certain:
        assert not found.rejected
        # Of 120 readings four are left out with their three rows each, or some of them.
        assert clean.residual_freedom - 12 <= found.residual_freedom < clean.residual_freedom
        assert found.ratio == pytest.approx(clean.ratio, abs=0.08)


def test_wild_readings_do_not_hide_what_is_missing(fanuc):
    campaign = planted(fanuc, {"joint_offset@3": [5e-4]}, seed=1)
    found = lack_of_fit(*some_wild(campaign, 1))
    assert found.rejected and found.ratio == pytest.approx(lack_of_fit(campaign.declared, campaign.observations).ratio, rel=0.1)


def test_ratio_is_the_mean_square_over_the_noise(fanuc):
    """Without robust weights and repeats, and the same noise for all: by hand."""
    campaign = planted(fanuc, {}, seed=2, poses=12)
    fitted = replace(campaign.declared, weights=np.ones(len(campaign.observations)))
    found = lack_of_fit(fitted, campaign.observations)
    rows, fitted_parameters = fitted.residual.size, 6
    assert found.residual_freedom == rows - fitted_parameters
    np.testing.assert_allclose(found.ratio, (fitted.residual**2).sum() / (rows - 6) / fitted.noise.position_m**2, rtol=1e-10)
    np.testing.assert_allclose(found.p_value, f.sf(found.ratio, rows - 6, found.noise_freedom))


def test_noise_from_more_repeats_rejects_sooner(fanuc):
    campaign = planted(fanuc, {"joint_offset@3": [1e-4]}, seed=3, poses=12)
    few, many = (
        lack_of_fit(with_noise(campaign.declared, source="repeats", degrees_of_freedom=n), campaign.observations)
        for n in (20, 2000)
    )
    assert (few.noise_freedom, many.noise_freedom) == (20, 2000)
    assert few.ratio == many.ratio > 1
    assert many.p_value < few.p_value


def test_twice_the_noise_makes_a_quarter_of_the_ratio(fanuc):
    campaign = planted(fanuc, {}, seed=4, poses=12)
    one = lack_of_fit(campaign.declared, campaign.observations)
    other = lack_of_fit(with_noise(campaign.declared, position_m=2 * campaign.declared.noise.position_m), campaign.observations)
    assert one.ratio == pytest.approx(4 * other.ratio)


def test_nothing_is_said_where_the_noise_is_unknown_or_nothing_is_left(fanuc):
    campaign = planted(fanuc, {"joint_offset@3": [5e-4]}, seed=5, poses=12)
    unknown = replace(campaign.declared, noise=Noise("residual", 1e-4, 1e-4, np.zeros(6)))
    rows = campaign.declared.residual.size
    exhausted = replace(campaign.declared, held=np.zeros(rows, bool))
    for fitted in (unknown, exhausted):
        found = lack_of_fit(fitted, campaign.observations)
        assert np.isnan(found.ratio) and np.isnan(found.p_value) and not found.rejected
