"""Corrected targets reach the wanted poses, and targets that cannot be corrected have a
status that says why."""

from dataclasses import replace

import numpy as np
import pytest
from analysed_robots import analysed
from made_calibrated import USUAL, make_calibrated_robot

from elastocal.application.accuracy import predict_errors
from elastocal.application.calibrated import compute_nominal_poses, find_equilibrium
from elastocal.application.compensation import (
    OK,
    OTHER_POSTURE,
    OUTSIDE_LIMITS,
    SINGULAR,
    UNREACHABLE,
    find_joint_targets,
    find_large_steps,
)
from elastocal.mechanics.kinematics import compute_jacobians, compute_pose_differences

EFFECTS = (
    *(key for key in USUAL if "weight" not in key),
    "transmission_harmonic@1[orders 1-2]",
)
# Angles from the middle of the limits to a posture that is not singular.
BENT = np.array([0.0, 0.2, 0.1, 0.3, 0.7, 0.0])


def make_calibrated(name, *keys):
    """A calibrated robot whose joints repeat to 10 µrad."""
    calibrated = make_calibrated_robot(analysed(name), *keys)
    joint_rad = np.full(calibrated.robot.joints, 1e-5)
    return replace(calibrated, noise=replace(calibrated.noise, joint_rad=joint_rad))


def with_joint_limits(calibrated, limits):
    return replace(calibrated, robot=replace(calibrated.robot, joint_limits=limits))


def draw_states(calibrated, count, force=100.0):
    """Reported angles within the limits, and a force and a moment for each."""
    robot = calibrated.robot
    stream = np.random.default_rng(2)
    low, high = robot.joint_limits.T
    shares = 0.5 + 0.8 * (stream.random((count, robot.joints)) - 0.5)
    scale = [force] * 3 + [0.3 * force] * 3
    wrench = stream.standard_normal((count, 6)) * scale
    return robot.reported_angles(low + (high - low) * shares), wrench


def settle(calibrated, commands, wrench):
    """Poses with the loads evaluated again until the arm has come to rest."""
    coordinates, position, rotation = find_equilibrium(calibrated, commands, wrench)
    for _ in range(6):
        coordinates, position, rotation = find_equilibrium(
            calibrated, commands, wrench, coordinates
        )
    return position, rotation


def find_unloaded_targets(calibrated, position, rotation, start=None):
    wrench = np.zeros((len(position), 6))
    return find_joint_targets(calibrated, position, rotation, wrench, start)


@pytest.mark.parametrize("name", ["gp180", "iiwa14"])
def test_corrected_targets_bring_the_robot_to_the_wanted_poses(name):
    calibrated = make_calibrated(name, *EFFECTS)
    robot = calibrated.robot
    commands, wrench = draw_states(calibrated, 150)
    position, rotation = compute_nominal_poses(robot, commands)
    correction = find_joint_targets(calibrated, position, rotation, wrench, commands)
    corrected = correction.status == OK
    assert corrected.mean() > 0.9
    settled = settle(calibrated, correction.joint_angles, wrench)
    error = compute_pose_differences(position, rotation, *settled)[corrected]
    assert np.abs(error).max() < 2e-9
    np.testing.assert_allclose(correction.error_after[corrected], error, atol=2e-9)
    before = correction.error_before[corrected, :3]
    assert np.sqrt((before**2).sum(axis=1).mean()) > 1e-4
    # The repeatability of the joints acts through the Jacobian at the corrected angles.
    angles = robot.model_angles(correction.joint_angles)
    jacobian = compute_jacobians(robot.chain, angles, robot.chain.end_effector)
    expected = 1e-5 * np.sqrt((jacobian[:, :3] ** 2).sum(axis=(1, 2)))
    prediction = predict_errors(calibrated, correction.joint_angles, wrench, draws=0)
    np.testing.assert_allclose(prediction.repeated_m, expected, rtol=1e-9)


def test_targets_that_cannot_be_corrected_say_why():
    calibrated = make_calibrated("gp180", *EFFECTS)
    robot = calibrated.robot
    low, high = robot.joint_limits.T
    angles = np.tile(0.5 * (low + high) + BENT, (4, 1))
    angles[1, 0] = high[0] + 0.2
    # The axes of joints 4 and 6 are in one line.
    angles[2, 4] = 0.0
    commands = robot.reported_angles(angles)
    position, rotation = compute_nominal_poses(robot, commands)
    position[3] *= 5.0
    correction = find_unloaded_targets(calibrated, position, rotation, commands)
    assert correction.status.tolist() == [OK, OUTSIDE_LIMITS, SINGULAR, UNREACHABLE]
    assert np.isfinite(correction.joint_angles).all()


@pytest.fixture(params=["kuka", "abb"])
def turned_path(request):
    """A robot, and a path of seven commands near the lower limit of the first joint."""
    calibrated = make_calibrated(request.param, *EFFECTS)
    limits = calibrated.robot.joint_limits.copy()
    limits[0] = np.radians([-185.0, 185.0])
    calibrated = with_joint_limits(calibrated, limits)
    angles = np.tile(limits.mean(axis=1) + BENT, (7, 1))
    angles[:, 0] = np.radians(np.linspace(-180.6, -168.6, 7))
    return calibrated, calibrated.robot.reported_angles(angles)


def test_a_stated_posture_and_its_turn_are_kept(turned_path):
    calibrated, commands = turned_path
    wanted = compute_nominal_poses(calibrated.robot, commands)
    first_posture = np.repeat(commands[:1], 7, axis=0)
    correction = find_unloaded_targets(calibrated, *wanted, first_posture)
    assert (correction.status == OK).all()
    assert np.abs(correction.joint_angles - commands).max() < 0.02


def test_a_stated_turn_is_kept_or_refused_at_the_limits(turned_path):
    calibrated, commands = turned_path
    wanted = compute_nominal_poses(calibrated.robot, commands)
    one_turn_more = commands.copy()
    one_turn_more[:, 0] += 2 * np.pi
    correction = find_unloaded_targets(calibrated, *wanted, one_turn_more)
    kept = correction.status == OK
    distance = np.abs(correction.joint_angles - one_turn_more)
    assert kept.any() and distance[kept].max() < 0.02
    assert set(correction.status[~kept]) <= {OUTSIDE_LIMITS}


def test_a_stated_posture_that_does_not_reach_the_pose_is_refused(turned_path):
    calibrated, commands = turned_path
    wanted = compute_nominal_poses(calibrated.robot, commands)
    correction = find_unloaded_targets(calibrated, *wanted, np.zeros_like(commands))
    statuses = set(correction.status)
    assert statuses <= {OTHER_POSTURE, UNREACHABLE, OUTSIDE_LIMITS}
    assert OTHER_POSTURE in statuses


def test_a_posture_behind_a_singular_one_is_another_however_near():
    """The second stated wrist bends a little to the other side."""
    calibrated = make_calibrated("gp180")
    robot = calibrated.robot
    angles = np.tile(robot.joint_limits.mean(axis=1) + BENT, (2, 1))
    angles[:, 4] = np.radians([5.0, 15.0])
    wanted = compute_nominal_poses(robot, robot.reported_angles(angles))
    stated = angles.copy()
    stated[:, 4] = np.radians([15.0, -1.0])
    correction = find_unloaded_targets(
        calibrated, *wanted, robot.reported_angles(stated)
    )
    assert correction.status.tolist() == [OK, OTHER_POSTURE]


@pytest.mark.parametrize("name", ["kuka", "iiwa14"])
def test_random_paths_have_no_large_steps(name):
    """With limits of 170 to 350 degrees either way."""
    stream = np.random.default_rng(5)
    completely_corrected = 0
    for _ in range(5):
        calibrated = make_calibrated(name)
        high = np.radians(stream.uniform(170.0, 350.0, calibrated.robot.joints))
        limits = np.stack([-high, high], axis=1)
        calibrated = with_joint_limits(calibrated, limits)
        robot = calibrated.robot
        start = stream.uniform(-high, high)
        walk = start + np.cumsum(stream.normal(0.0, 0.06, (10, len(high))), axis=0)
        commands = robot.reported_angles(walk.clip(-high, high))
        position, rotation = compute_nominal_poses(robot, commands)
        correction = find_unloaded_targets(calibrated, position, rotation)
        corrected = correction.status == OK
        completely_corrected += corrected.all()
        assert not find_large_steps(
            robot,
            position[corrected],
            rotation[corrected],
            correction.joint_angles[corrected],
        )
    assert completely_corrected >= 4
