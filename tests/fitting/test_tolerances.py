"""Declared geometry has one prior, whose size the measurements make most probable; and what priors leave of parameters.

Noise of a campaign that neither repeats nor declares: what the declared model leaves of positions and of orientations.
"""

from dataclasses import replace

import numpy as np
import pytest
from made_campaigns import Plan, made
from planted import planted
from scipy.spatial.transform import Rotation

from elastocal.fitting.least_squares import fit
from elastocal.fitting.model import Case, declared_model
from elastocal.fitting.observations import averaged
from elastocal.fitting.tolerances import (
    SIZES,
    declared_geometry,
    effective_parameters,
    estimated_noise,
    fit_declared,
    most_probable,
    with_size,
)

JOINTS = (2, 3, 4, 5)


def campaign_of(robot, offset, **options):
    """A robot whose joints 2 to 5 are off by an angle or its opposite, and its model with these offsets declared."""
    keys = [f"joint_offset@{joint}" for joint in JOINTS]
    campaign = planted(robot, {key: [offset * (-1) ** n] for n, key in enumerate(keys)}, seed=2, **options)
    return campaign, campaign.declared.model.with_effects([campaign.candidates[key] for key in keys])


def wide_fit(campaign, model, share=1.0):
    return fit(with_size(model, SIZES[-1]), campaign.observations, campaign.declared.noise.scaled(share))


@pytest.mark.parametrize(("offset", "size"), [(1e-4, 0.1), (1e-3, 1.0), (1e-2, 10.0)])
def test_declared_geometry_has_the_size_that_the_measurements_make_most_probable(offset, size, kuka):
    campaign, model = campaign_of(kuka, offset)
    # Springs of the joints have no size: they have no prior.
    assert declared_geometry(model) == {"joint_offset"}
    assert most_probable(wide_fit(campaign, model))[0] == pytest.approx(size, rel=0.01)
    fitted = fit_declared(model, campaign.observations, campaign.declared.noise)
    priors = {owner: parameter.prior_std for owner, parameter in fitted.parameters}
    assert [priors[f"joint_offset@{joint}"] for joint in JOINTS] == pytest.approx([size * 1e-3] * 4, rel=0.01)
    assert priors["joint_compliance"] is None


@pytest.mark.parametrize("share", [1.0, 0.1, 0.01])
def test_the_size_is_the_same_whatever_noise_was_taken_and_the_noise_comes_back(share, kuka):
    """Noise that is declared far too small must not make sizes small: they would be so many standard errors, not so many mm."""
    campaign, model = campaign_of(kuka, 1e-3)
    size, factor = most_probable(wide_fit(campaign, model, share))
    assert size == pytest.approx(1.0, rel=0.01)
    assert factor == pytest.approx(1.0 / share, rel=0.15)


def test_effective_parameters_are_the_trace_of_the_hat_matrix(kuka):
    campaign, model = campaign_of(kuka, 1e-4, poses=6)
    fitted = fit(with_size(model, 0.1), campaign.observations, campaign.declared.noise.scaled(30.0))
    rows = np.concatenate([white.reshape(-1, len(fitted.held)) for _, _, white in fitted.sensitivities(campaign.observations)])
    assert effective_parameters(fitted) == pytest.approx(np.trace(rows @ fitted.covariance @ rows.T), rel=1e-3)
    assert effective_parameters(fitted) < (~fitted.held).sum() - 0.5


def case_of(robot, off=0.0, turned=0.0, noise=None, oriented=True, repeats=1):
    """A known robot whose measurements are off by so much and turned by so much: nothing is left to fit."""
    plan = Plan(poses=8, loads=1, repeats=repeats, noise=0.0, force=0.0, oriented=oriented)
    campaign = replace(made(robot, 3, plan), compliance="nominal", noise=noise)
    seen = campaign.measurements
    seen = replace(seen, position=seen.position + off)
    if oriented:
        turns = Rotation.from_rotvec(np.zeros_like(seen.position) + turned)
        vectors = turns * Rotation.from_rotvec(seen.rotation_vector)
        seen = replace(seen, rotation_vector=vectors.as_rotvec())
    campaign = replace(campaign, measurements=seen)
    return Case(campaign, averaged(seen), declared_model(campaign), {})


def errors(seed, size, repeats=1):
    return size * np.random.default_rng(seed).standard_normal((8 * 2 * 4 * repeats, 3))


@pytest.mark.parametrize("oriented", [False, True])
def test_noise_is_the_root_mean_square_of_the_residual_where_nothing_else_says_it(fanuc, oriented):
    off, turned = errors(1, 70e-6), errors(2, 20e-6)
    noise, warnings = estimated_noise(case_of(fanuc, off, turned, oriented=oriented))
    assert noise.source == "residual" and noise.degrees_of_freedom == 0 and noise.pose_rad == 0.0
    assert noise.position_m == pytest.approx(np.sqrt((off**2).mean()), rel=1e-6)
    # Where no orientation is measured it counts as in a declaration, as many radians as metres.
    assert noise.orientation_rad == pytest.approx(np.sqrt(((turned if oriented else off) ** 2).mean()), rel=1e-6)
    np.testing.assert_array_equal(noise.joint_rad, np.zeros(6))
    assert len(warnings) == 1 and "no repeats and no declared noise" in warnings[0]
