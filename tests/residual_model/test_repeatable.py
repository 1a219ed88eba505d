"""A residual that is a function of the joint angles is distinguished from chance, even
though a fit has removed from chance what its parameters can follow."""

from dataclasses import replace

import numpy as np
import pytest
from made_remainders import NOISE_M, smoothly_wrong_cases

from elastocal.fitting.least_squares import fit_model
from elastocal.fitting.noise import Noise
from elastocal.residual_model.repeatable import detect_repeatable_residual

NOISE = Noise("declared", NOISE_M, NOISE_M, np.zeros(6))


@pytest.fixture(scope="module")
def smooth(kuka, config_folder, tmp_path_factory):
    """The training case of a robot with smooth errors, and its fit."""
    changes = {"poses": 90, "declared": ["joint_offset", "link_geometry"]}
    case, _ = smoothly_wrong_cases(
        tmp_path_factory.mktemp("repeatable"), kuka, config_folder / "robots", **changes
    )
    return case, fit_model(case.model, case.observations, NOISE)


def test_a_smooth_residual_is_repeatable_and_its_size_is_stated(smooth):
    case, fitted = smooth
    repeatable = detect_repeatable_residual(fitted, case.observations, 1)
    rms_m = np.sqrt((fitted.residual**2).sum(axis=1).mean())
    assert repeatable.remains and repeatable.p_value <= 0.01
    assert 0.4 * rms_m < repeatable.rms_m < rms_m
    assert repeatable.rms_std_error_m < 0.3 * repeatable.rms_m


def test_chance_is_called_repeatable_no_more_often_than_stated(smooth):
    """Noise passes through the same fit. Of 30 data sets, a test at 5 % passes more than
    four with a probability of 2 %."""
    case, fitted = smooth
    stream = np.random.default_rng(3)
    blocks = list(fitted.iterate_sensitivities(case.observations))
    sensitivities = np.concatenate([block[1] for block in blocks])
    whitened = np.concatenate([block[2] for block in blocks])
    p_values = []
    for seed in range(30):
        noise = stream.normal(0.0, NOISE_M, fitted.residual.shape)
        gradient = np.einsum("mrp,mr->p", whitened, fitted.whiten(noise))
        residual = noise - sensitivities @ (fitted.covariance @ gradient)
        refitted = replace(fitted, residual=residual)
        repeatable = detect_repeatable_residual(refitted, case.observations, seed)
        p_values.append(repeatable.p_value)
    assert sum(p_value <= 0.05 for p_value in p_values) <= 4


def test_too_few_configurations_have_no_result(kuka, config_folder, tmp_path):
    case, _ = smoothly_wrong_cases(tmp_path, kuka, config_folder / "robots", poses=12)
    fitted = fit_model(case.model, case.observations, NOISE)
    assert detect_repeatable_residual(fitted, case.observations, 1) is None
