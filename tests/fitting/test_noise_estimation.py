"""Noise of a campaign that neither repeats nor declares: what the declared model leaves of positions and of orientations."""

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from made_campaigns import Plan, made
from scipy.spatial.transform import Rotation

from elastocal.fitting.case import Case
from elastocal.fitting.model import declared_model
from elastocal.fitting.noise import FINEST
from elastocal.fitting.noise_estimation import estimated_noise
from elastocal.fitting.observations import averaged


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


@pytest.mark.parametrize(("position_m", "orientation_rad"), [(70e-6, 0.0), (0.0, 20e-6)])
def test_a_residual_finer_than_any_sensor_is_taken_as_what_a_sensor_resolves(fanuc, position_m, orientation_rad):
    off, turned = errors(1, position_m), errors(2, orientation_rad)
    noise, _ = estimated_noise(case_of(fanuc, off, turned))
    for found, part in ((noise.position_m, off), (noise.orientation_rad, turned)):
        assert found == pytest.approx(max(np.sqrt((part**2).mean()), FINEST), rel=1e-6)


def test_repeats_come_before_the_residual(fanuc):
    """Measurements a millimetre off the model and repeated to some hundredths."""
    noise, warnings = estimated_noise(case_of(fanuc, 1e-3 + errors(1, 30e-6, 2), 1e-3 + errors(2, 15e-6, 2), repeats=2))
    assert noise.source == "repeats" and warnings == []
    # Within four standard errors of what 192 contrasts tell.
    assert noise.position_m == pytest.approx(30e-6, rel=4 / np.sqrt(2 * 192))
    assert noise.orientation_rad == pytest.approx(15e-6, rel=4 / np.sqrt(2 * 192))


def peak_bytes(robot, poses):
    """Most memory that the noise of a campaign takes which has 12 measurements a pose and neither repeats nor a declaration."""
    plan = Plan(poses=poses, loads=2, repeats=1, noise=1e-5)
    campaign = replace(made(robot, 3, plan), compliance="identify", noise=None)
    case = Case(campaign, averaged(campaign.measurements), declared_model(campaign), {})
    assert len(campaign.measurements) == 12 * poses
    tracemalloc.start()
    estimated_noise(case)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return peak


def test_a_measurement_more_takes_no_more_than_its_residual(fanuc, monkeypatch):
    """A million measurements took 19.8 GB here once; held at once, each takes 13 kB."""
    monkeypatch.setattr("elastocal.fitting.displacement._MOST_STATES", 40)
    monkeypatch.setattr("elastocal.fitting.displacement._MOST_AT_ONCE", 40)
    monkeypatch.setattr("elastocal.fitting.displacement._MOST_HELD", 40 * 6 * 60)
    few, more = peak_bytes(fanuc, 24), peak_bytes(fanuc, 96)
    assert more - few < 400 * 12 * (96 - 24)
