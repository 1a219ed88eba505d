"""Repeatability after ISO 9283: closed forms for normal noise, whatever the number of repeats."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi
from synthetic import made_measurements, made_model

from elastocal.application.certificate.repeatability import of_sensor, repeatability
from elastocal.campaigns.campaign import Target

TARGETS = (Target("A", "6DoF", (0.0, 0.0, 0.0)), Target("B", "3DoF", (0.0, 0.0, 0.0)))
NOISE_M = 50e-6


def measure(fanuc, poses, repeats, seed=0, rows=3, noise=NOISE_M):
    model = made_model(fanuc.chain, TARGETS, rows, fitted_frames=False, compliance=fanuc.compliance)
    return made_measurements(model, np.random.default_rng(seed), poses, repeats, noise, 0.0, 30e-6)


@pytest.mark.parametrize("repeats", [2, 4, 30])
def test_noise_alone_has_the_repeatability_of_a_chi_distribution(fanuc, repeats):
    """3600 lengths: 5 % is three standard errors. Without the degree of freedom, two repeats give 30 % less."""
    found = repeatability(measure(fanuc, 3600 // repeats, repeats), TARGETS, "6DoF")
    expected = (chi.mean(3) + 3 * chi.std(3)) * NOISE_M
    # Of two repeats both lengths are the same one.
    assert found.position_m == pytest.approx(expected, rel=0.05)
    assert of_sensor(NOISE_M) == pytest.approx(expected)
    assert (found.poses, found.approaches) == (3600 // repeats, 3600 // repeats * repeats)


def test_ten_poses_of_four_have_an_interval_that_holds_the_value(fanuc):
    """95 % of 60; 50 or fewer have a probability of 2e-4 there, and of 0.5 where it held 84 %."""
    expected = of_sensor(NOISE_M)
    found = [repeatability(measure(fanuc, 10, 4, seed), TARGETS, "6DoF").position_interval_m for seed in range(60)]
    assert sum(low <= expected <= high for low, high in found) > 50


def test_orientations_count_where_they_are_measured(fanuc):
    assert repeatability(measure(fanuc, 10, 4), TARGETS, "6DoF").orientation_rad is None
    found = repeatability(measure(fanuc, 600, 6, rows=6), TARGETS, "6DoF")
    assert found.orientation_rad == pytest.approx(of_sensor(30e-6), rel=0.05)


def test_only_targets_of_the_end_effector_count_unless_there_is_none(fanuc):
    data = measure(fanuc, 20, 4)
    size = np.where((data.target == 1)[:, None], 1e-2, 1e-4)
    off = size * np.random.default_rng(1).standard_normal(data.position.shape)
    worse = replace(data, position=data.position + off)
    assert repeatability(worse, TARGETS, "6DoF").position_m < 1e-3
    assert repeatability(worse, TARGETS, "2DoF").position_m > 1e-2


def test_without_repeats_nothing_is_known(fanuc):
    assert repeatability(measure(fanuc, 5, 1), TARGETS, "6DoF") is None
    assert repeatability(measure(fanuc, 1, 5), TARGETS, "6DoF") is None
