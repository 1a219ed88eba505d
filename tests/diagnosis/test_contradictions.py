"""No model is adequate that leaves scatter or compliances which no robot has."""

from dataclasses import replace

import numpy as np
import pytest
from planted import planted

from elastocal.diagnosis.contradictions import contradictions, pose_error_warnings, scatter_warnings
from elastocal.diagnosis.settings import Settings
from elastocal.fitting.displacement import joint_compliances
from elastocal.fitting.noise import Noise

SETTINGS = Settings()


@pytest.fixture(scope="module")
def fitted(kuka):
    return planted(kuka, {}, seed=6, poses=8).declared


def with_noise(fitted, **changes):
    return replace(fitted, noise=replace(fitted.noise, **changes))


@pytest.mark.parametrize(("factor", "count"), [(4.9, 0), (5.1, 1), (270.0, 1)])
def test_scatter_far_beyond_the_noise_measured_is_one(fitted, factor, count):
    left, repeats = with_noise(fitted, position_m=factor * fitted.noise.position_m), replace(fitted.noise, source="repeats")
    found = contradictions(left, repeats, SETTINGS)
    assert len(found) == count
    assert all("scatter about the model" in sentence for sentence in found)
    assert contradictions(left, replace(repeats, source="declared"), SETTINGS) == []


@pytest.mark.parametrize(("pose_rad", "count"), [(4e-4, 0), (1e-3, 1)])
def test_an_error_of_a_pose_beyond_that_of_drives_is_one(fitted, pose_rad, count):
    found = contradictions(with_noise(fitted, pose_rad=pose_rad), fitted.noise, SETTINGS)
    assert len(found) == count
    assert all("1000 µrad" in sentence for sentence in found)


@pytest.mark.parametrize(
    ("errors", "named"), [(2.5, []), (4.5, ["the compliance of joint 3 is negative by 4.5 standard errors"])]
)
def test_a_compliance_that_is_negative_beyond_chance_is_one(fitted, errors, named):
    mine = np.array([owner == "joint_compliance" for owner, _ in fitted.parameters])
    values = joint_compliances(fitted.model, fitted.estimate).copy()
    values[2] = -errors * np.sqrt(np.diag(fitted.covariance))[mine][2]
    coefficients = tuple(
        values if effect.effect == "joint_compliance" else each
        for effect, each in zip(fitted.model.effects, fitted.estimate.coefficients, strict=True)
    )
    off = replace(fitted, estimate=replace(fitted.estimate, coefficients=coefficients))
    assert contradictions(off, fitted.noise, SETTINGS) == named


@pytest.mark.parametrize(
    ("factor", "source", "words"),
    [
        (1.49, "repeats", None),
        (2.04, "repeats", "2.0 times as much as their repeats about each other"),
        (11.6, "declared", "12 times as much as the noise that is declared for them"),
    ],
)
def test_noise_that_is_much_larger_than_it_was_taken_is_a_warning_from_one_and_a_half_times_on(factor, source, words):
    taken = Noise(source, 6e-5, 6e-5, np.zeros(6))
    found = scatter_warnings(taken.scaled(factor), taken, SETTINGS.relinearize_noise)
    assert found == ([f"measurements scatter about the model {words}"] if words else [])


def test_a_pose_error_is_a_warning_from_the_size_that_repeats_of_a_pose_could_show():
    noise = Noise("declared", 6e-5, 6e-5, np.zeros(6))
    below, above = (pose_error_warnings(replace(noise, pose_rad=size), 2e-5) for size in (1.9e-5, 3.4e-5))
    assert below == [] and len(above) == 1 and "every joint were 34 µrad off" in above[0]
