"""Two campaigns of one robot: a change is seen where there is one, and seldom where there is none."""

from dataclasses import replace

import numpy as np
import pytest
from made_calibrated import USUAL, made_calibrated
from scipy.stats import binom

from elastocal.application.accuracy import remove_rigid_motion
from elastocal.application.certificate.comparison import compare_campaigns
from elastocal.application.certificate.workspace import draw_angles
from elastocal.errors import InputError
from elastocal.fitting.parameters import stepped

DRAWS = 400


def measured_again(calibrated, rng):
    """The same robot as another campaign would find it."""
    root = np.linalg.cholesky(calibrated.covariance)
    return replace(calibrated, estimate=stepped(calibrated.model, calibrated.estimate, root @ rng.standard_normal(len(root))))


def comparison(before, after, seed=0, poses=60, draws=DRAWS):
    angles = draw_angles(before, poses, np.random.default_rng(5))
    return compare_campaigns(before, after, angles, draws, np.random.default_rng(seed))


@pytest.fixture(scope="module")
def calibrated(fanuc):
    return made_calibrated(fanuc, *USUAL)


@pytest.mark.slow
def test_a_robot_that_did_not_change_seldom_seems_changed(calibrated):
    """At 5 % in 80 pairs; 10 or more have a probability of 0.7 % there, and of 0.99 at a rate of 20 %.

    By 99 draws a p-value is at most 0.05 in exactly 5 %.
    """
    rng = np.random.default_rng(1)
    pairs = [(measured_again(calibrated, rng), measured_again(calibrated, rng)) for _ in range(80)]
    found = [comparison(*pair, seed, poses=10, draws=99) for seed, pair in enumerate(pairs)]
    assert sum(each.p_value <= 0.05 for each in found) <= binom.ppf(0.993, 80, 0.05)
    assert sum(min(change.p_value for change in each.changes) < 0.05 for each in found) <= binom.ppf(0.993, 80, 0.05)


def test_a_joint_that_slipped_is_seen_and_named_first(calibrated):
    number = [effect.key for effect in calibrated.model.effects].index("joint_offset@3")
    values = list(calibrated.estimate.coefficients)
    errors = np.sqrt(np.diag(calibrated.covariance))
    values[number] = values[number] + 30 * errors[: len(values[number])].max() + 2e-3
    slipped = replace(calibrated, estimate=replace(calibrated.estimate, coefficients=tuple(values)))
    found = comparison(calibrated, slipped)
    assert found.p_value == pytest.approx(1 / (1 + DRAWS)) and found.rms_m > 3 * found.expected_m
    first, second = found.changes[:2]
    assert (first.owner, first.name) == ("joint_offset@3", calibrated.model.effects[number].parameters[0].name)
    assert first.after - first.before == pytest.approx(values[number][0] - calibrated.estimate.coefficients[number][0])
    assert first.p_value < 1e-6 < second.p_value


def test_the_same_campaign_has_not_changed(calibrated):
    found = comparison(calibrated, calibrated)
    assert (found.rms_m, found.p_value) == (0.0, 1.0) and found.expected_m > 0


def test_a_base_that_was_set_up_elsewhere_is_no_change():
    rng = np.random.default_rng(2)
    position = rng.standard_normal((50, 3))
    moved = 1e-4 * np.cross([0.3, -0.2, 0.5], position) + [1e-3, 2e-3, -1e-3]
    np.testing.assert_allclose(remove_rigid_motion(moved, position), 0.0, atol=1e-15)
    stretched = position * [1e-3, 0, 0]
    assert np.abs(remove_rigid_motion(stretched, position)).max() > 1e-4


def test_campaigns_that_identify_other_parameters_are_compared_as_a_whole_alone(calibrated, fanuc):
    assert comparison(calibrated, made_calibrated(fanuc, *USUAL[:-1])).changes == ()


def test_another_robot_is_refused(calibrated, kuka):
    with pytest.raises(InputError, match="another robot"):
        comparison(calibrated, made_calibrated(kuka, *USUAL))
