"""The use of a robot: wanted poses are corrected, and those beyond what was fitted or out of reach are named."""

import numpy as np
import pytest
from made_calibrated import USUAL, made_calibrated
from planted import planted

from elastocal.application.calibrated import nominal_forward
from elastocal.application.certificate.use import use_at
from elastocal.exchange.target_path import TargetPath


@pytest.fixture(scope="module")
def calibrated(kuka):
    return made_calibrated(kuka, *USUAL)


def path_at(calibrated, angles, wrench):
    position, rotation = nominal_forward(calibrated.robot, calibrated.robot.reported_angles(angles))
    count = len(angles)
    start = calibrated.robot.reported_angles(angles)
    lines = tuple(range(2, count + 2))
    return TargetPath(position, rotation, start, np.tile(wrench, (count, 1)), None, None, None, lines)


def test_poses_within_what_was_fitted_are_corrected_and_not_beyond(kuka, calibrated):
    states = planted(kuka, {}, seed=1, poses=20).observations.states
    angles = np.array([0.0, -0.6, 0.5, 0.3, 0.6, 0.1]) + 0.1 * np.eye(6)[:3]
    used = use_at(calibrated, states, path_at(calibrated, angles, np.zeros(6)))
    assert not used.outside.any()
    assert np.abs(kuka.model_angles(used.reported_angles) - angles).max() < 0.02
