"""Errors over the workspace, and bounds that hold as often as they say."""

from dataclasses import replace

import numpy as np
import pytest
from made_calibrated import USUAL, made_calibrated
from scipy.stats import chi, norm

from elastocal.application.accuracy import quantile_of_length
from elastocal.application.calibrated import forward
from elastocal.application.certificate.workspace import draw_angles, workspace_errors
from elastocal.fitting.parameters import stepped


@pytest.fixture(scope="module")
def calibrated(fanuc):
    found = made_calibrated(fanuc, *USUAL)
    return replace(found, noise=replace(found.noise, joint_rad=np.full(6, 1e-5)))


def found_for(calibrated, count=300):
    angles = draw_angles(calibrated, count, np.random.default_rng(0))
    return workspace_errors(calibrated, angles, np.zeros(6), calibrated.robot.model_angles(angles[: count // 2]))


def test_quantiles_are_those_of_one_and_of_three_directions_and_hold_between():
    alike, single = np.eye(3), np.diag([1.0, 0.0, 0.0])
    found = quantile_of_length(np.stack([alike, single, np.zeros((3, 3))]))
    np.testing.assert_allclose(found, [chi.ppf(0.95, 3), norm.ppf(0.975), 0.0], rtol=1e-12)
    rng = np.random.default_rng(1)
    for scales in ([1.0, 0.5, 0.1], [1.0, 1.0, 0.2], [1.0, 0.1, 0.1]):
        lengths = np.linalg.norm(rng.standard_normal((200_000, 3)) * scales, axis=1)
        bound = quantile_of_length(np.diag(np.square(scales))[None])[0]
        # The gamma distribution has two of the moments.
        assert np.mean(lengths < bound) == pytest.approx(0.95, abs=0.01)


def test_bounds_hold_95_percent_of_robots_drawn_from_the_covariance(calibrated):
    """100 robots at 100 poses; robots err at many poses alike, so that the share is known to some 2 %."""
    rng = np.random.default_rng(2)
    found = found_for(calibrated, 100)
    root = np.linalg.cholesky(calibrated.covariance)
    inside = []
    for _ in range(100):
        step = root @ rng.standard_normal(len(root))
        other = replace(calibrated, estimate=stepped(calibrated.model, calibrated.estimate, step))
        repeated = found.joint_angles + 1e-5 * rng.standard_normal(found.joint_angles.shape)
        inside.append(np.linalg.norm(forward(other, repeated)[0] - found.position, axis=1) < found.bound_m)
    assert np.mean(inside) == pytest.approx(0.95, abs=0.03)
