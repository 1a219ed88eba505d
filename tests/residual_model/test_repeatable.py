"""What is a function of the joints is told from chance, though a fit has taken out of
chance what it can follow."""

from dataclasses import replace

import numpy as np
import pytest
from made_remainders import NOISE_M, smoothly_wrong_cases

from elastocal.fitting.least_squares import fit_model
from elastocal.fitting.noise import Noise
from elastocal.residual_model.repeatable import detect_repeatable_residual


@pytest.fixture(scope="module")
def smooth(kuka, config_folder, tmp_path_factory):
    changes = {"poses": 90, "declared": ["joint_offset", "link_geometry"]}
    case, _ = smoothly_wrong_cases(
        tmp_path_factory.mktemp("repeatable"), kuka, config_folder / "robots", **changes
    )
    return case, fit_model(
        case.model, case.observations, Noise("declared", NOISE_M, NOISE_M, np.zeros(6))
    )


def test_a_smooth_remainder_remains_with_its_size_and_its_signs_turned_it_does_not(
    smooth,
):
    case, fitted = smooth
    found = detect_repeatable_residual(fitted, case.observations, 1)
    left = np.sqrt((fitted.residual**2).sum(axis=1).mean())
    assert found.remains and found.p_value <= 0.01
    assert 0.4 * left < found.rms_m < left and found.rms_std_error_m < 0.3 * found.rms_m


def test_chance_is_called_repeatable_no_more_often_than_stated(smooth):
    """Noise through the same fit: of 30, a test at 5 % passes more than four with a
    probability of 2 %."""
    case, fitted = smooth
    draws = np.random.default_rng(3)
    passed = []
    sensitivities, white = (
        np.concatenate(parts)
        for parts in list(
            zip(*fitted.iterate_sensitivities(case.observations), strict=True)
        )[1:]
    )
    for seed in range(30):
        noise = draws.normal(0.0, NOISE_M, fitted.residual.shape)
        step = fitted.covariance @ np.einsum("mrp,mr->p", white, fitted.whiten(noise))
        found = detect_repeatable_residual(
            replace(fitted, residual=noise - sensitivities @ step),
            case.observations,
            seed,
        )
        passed.append(found.p_value <= 0.05)
    assert sum(passed) <= 4


def test_too_few_configurations_say_nothing(kuka, config_folder, tmp_path):
    case, _ = smoothly_wrong_cases(tmp_path, kuka, config_folder / "robots", poses=12)
    fitted = fit_model(
        case.model, case.observations, Noise("declared", NOISE_M, NOISE_M, np.zeros(6))
    )
    assert detect_repeatable_residual(fitted, case.observations, 1) is None
