"""Corrected targets put back into the forward model, and what is said of those that cannot be corrected."""

from dataclasses import replace

import numpy as np
import pytest
from analysed_robots import analysed
from made_calibrated import USUAL, made_calibrated

from elastocal.application.accuracy import predict_errors
from elastocal.application.calibrated import (
    NEUTRAL,
    OperatingConditions,
    coordinates_at_rest,
    end_effector,
    nominal_forward,
)
from elastocal.application.compensation import OK, OUTSIDE_LIMITS, SINGULAR, UNREACHABLE, find_joint_targets
from elastocal.mechanics.kinematics import jacobians
from elastocal.mechanics.pose_differences import pose_differences

EFFECTS = (*(key for key in USUAL if "weight" not in key), "transmission_harmonic@1[orders 1-2]")
# From the middle of the limits to a posture that is not singular.
BENT = np.array([0.0, 0.2, 0.1, 0.3, 0.7, 0.0])


def make_robot(name, *keys):
    robot = made_calibrated(analysed(name), *keys)
    return replace(robot, noise=replace(robot.noise, joint_rad=np.full(robot.robot.joints, 1e-5)))


def draw_states(calibrated, count, force=100.0):
    """Reported angles within the limits, and a force and a moment for each."""
    robot, draws = calibrated.robot, np.random.default_rng(2)
    low, high = robot.joint_limits.T
    angles = low + (high - low) * (0.5 + 0.8 * (draws.random((count, robot.joints)) - 0.5))
    wrench = draws.standard_normal((count, 6)) * ([force] * 3 + [0.3 * force] * 3)
    return robot.reported_angles(angles), OperatingConditions(wrench)


def settle(robot, angles, operating):
    """As `forward`, with the loads found again until the arm has come to rest."""
    coordinates = coordinates_at_rest(robot, angles, operating)
    for _ in range(5):
        coordinates = coordinates_at_rest(robot, angles, operating, coordinates)
    return end_effector(robot, coordinates)


@pytest.mark.parametrize("name", ["gp180", "ur10", "fanuc_static", "iiwa14"])
def test_corrected_targets_bring_the_robot_to_the_wanted_poses(name):
    robot = make_robot(name, *EFFECTS)
    angles, operating = draw_states(robot, 150)
    position, rotation = nominal_forward(robot.robot, angles)
    found = find_joint_targets(robot, position, rotation, operating, angles)
    good = found.status == OK
    assert good.mean() > 0.9
    off = pose_differences(position, rotation, *settle(robot, found.joint_angles, operating))[good]
    assert np.abs(off).max() < 2e-9
    np.testing.assert_allclose(found.error_after[good], off, atol=2e-9)
    assert np.sqrt((found.error_before[good, :3] ** 2).sum(axis=1).mean()) > 1e-4


def test_repeatability_is_that_of_the_joints_seen_through_the_jacobian():
    """20,000 draws: standard errors of the distances are 0.4 %."""
    robot = make_robot("gp180")
    angles, operating = draw_states(robot, 4)
    found = find_joint_targets(robot, *nominal_forward(robot.robot, angles), operating, angles)
    draws = np.random.default_rng(1).standard_normal((20000, 6)) * robot.noise.joint_rad
    jacobian = jacobians(robot.robot.chain, robot.robot.model_angles(found.joint_angles), robot.robot.chain.end_effector)
    distances = np.linalg.norm(draws @ jacobian[:, :3].transpose(0, 2, 1), axis=2)
    stated = predict_errors(robot, found.joint_angles, operating).repeated_m
    np.testing.assert_allclose(stated, np.sqrt((distances**2).mean(axis=1)), rtol=0.03)


def test_what_cannot_be_corrected_is_named():
    robot = make_robot("gp180", *EFFECTS)
    low, high = robot.robot.joint_limits.T
    angles = np.tile(0.5 * (low + high) + BENT, (4, 1))
    angles[1, 0] = high[0] + 0.2
    # The axes of joints 4 and 6 in one line.
    angles[2, 4] = 0.0
    reported = robot.robot.reported_angles(angles)
    position, rotation = nominal_forward(robot.robot, reported)
    position[3] *= 5.0
    found = find_joint_targets(robot, position, rotation, NEUTRAL, reported)
    assert found.status.tolist() == [OK, OUTSIDE_LIMITS, SINGULAR, UNREACHABLE]
    assert np.isfinite(found.joint_angles).all()


def test_a_path_without_a_start_is_corrected_in_one_posture():
    robot = make_robot("gp180", *EFFECTS)
    angles = robot.robot.joint_limits.mean(axis=1) + BENT + 0.2 * np.linspace(0.0, 1.0, 30)[:, None]
    done = []
    position, rotation = nominal_forward(robot.robot, robot.robot.reported_angles(angles))
    found = find_joint_targets(robot, position, rotation, NEUTRAL, progress=done.append)
    assert (found.status == OK).all()
    assert np.abs(np.diff(found.joint_angles, axis=0)).max() < 0.05
    assert done == [30]
