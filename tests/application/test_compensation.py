"""Corrected targets put back into the forward model, and what is said of those that
cannot be corrected."""

from dataclasses import replace

import numpy as np
import pytest
from analysed_robots import analysed
from made_calibrated import USUAL, made_calibrated

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
from elastocal.mechanics.kinematics import jacobians, pose_differences

EFFECTS = (
    *(key for key in USUAL if "weight" not in key),
    "transmission_harmonic@1[orders 1-2]",
)
# From the middle of the limits to a posture that is not singular.
BENT = np.array([0.0, 0.2, 0.1, 0.3, 0.7, 0.0])


def make_robot(name, *keys):
    robot = made_calibrated(analysed(name), *keys)
    return replace(
        robot, noise=replace(robot.noise, joint_rad=np.full(robot.robot.joints, 1e-5))
    )


def draw_states(calibrated, count, force=100.0):
    """Reported angles within the limits, and a force and a moment for each."""
    robot = calibrated.robot
    draws = np.random.default_rng(2)
    low, high = robot.joint_limits.T
    angles = low + (high - low) * (
        0.5 + 0.8 * (draws.random((count, robot.joints)) - 0.5)
    )
    wrench = draws.standard_normal((count, 6)) * ([force] * 3 + [0.3 * force] * 3)
    return robot.reported_angles(angles), wrench


def settle(robot, angles, wrench):
    """As `forward`, with the loads found again until the arm has come to rest."""
    found = find_equilibrium(robot, angles, wrench)
    for _ in range(6):
        found = find_equilibrium(robot, angles, wrench, found[0])
    return found[1:]


@pytest.mark.parametrize("name", ["gp180", "iiwa14"])
def test_corrected_targets_bring_the_robot_to_the_wanted_poses(name):
    robot = make_robot(name, *EFFECTS)
    angles, wrench = draw_states(robot, 150)
    position, rotation = compute_nominal_poses(robot.robot, angles)
    found = find_joint_targets(robot, position, rotation, wrench, angles)
    good = found.status == OK
    assert good.mean() > 0.9
    off = pose_differences(
        position, rotation, *settle(robot, found.joint_angles, wrench)
    )[good]
    assert np.abs(off).max() < 2e-9
    np.testing.assert_allclose(found.error_after[good], off, atol=2e-9)
    assert np.sqrt((found.error_before[good, :3] ** 2).sum(axis=1).mean()) > 1e-4
    # Each joint repeats to 10 µrad: seen through the Jacobian of where it stands.
    jacobian = jacobians(
        robot.robot.chain,
        robot.robot.model_angles(found.joint_angles),
        robot.robot.chain.end_effector,
    )
    stated = predict_errors(robot, found.joint_angles, wrench, draws=0).repeated_m
    np.testing.assert_allclose(
        stated, 1e-5 * np.sqrt((jacobian[:, :3] ** 2).sum(axis=(1, 2))), rtol=1e-9
    )


def test_what_cannot_be_corrected_is_named():
    robot = make_robot("gp180", *EFFECTS)
    low, high = robot.robot.joint_limits.T
    angles = np.tile(0.5 * (low + high) + BENT, (4, 1))
    angles[1, 0] = high[0] + 0.2
    # The axes of joints 4 and 6 in one line.
    angles[2, 4] = 0.0
    reported = robot.robot.reported_angles(angles)
    position, rotation = compute_nominal_poses(robot.robot, reported)
    position[3] *= 5.0
    found = find_joint_targets(
        robot, position, rotation, np.zeros((len(position), 6)), reported
    )
    assert found.status.tolist() == [OK, OUTSIDE_LIMITS, SINGULAR, UNREACHABLE]
    assert np.isfinite(found.joint_angles).all()


@pytest.mark.parametrize("name", ["kuka", "abb"])
def test_a_stated_posture_and_its_turn_are_kept_or_refused(name):
    robot = make_robot(name, *EFFECTS)
    limits = robot.robot.joint_limits.copy()
    limits[0] = np.radians([-185.0, 185.0])
    robot = replace(robot, robot=replace(robot.robot, joint_limits=limits))
    angles = np.tile(robot.robot.joint_limits.mean(axis=1) + BENT, (7, 1))
    angles[:, 0] = np.radians(np.linspace(-180.6, -168.6, 7))
    angles = robot.robot.reported_angles(angles)
    position, rotation = compute_nominal_poses(robot.robot, angles)
    found = find_joint_targets(
        robot,
        position,
        rotation,
        np.zeros((len(position), 6)),
        np.repeat(angles[:1], 7, axis=0),
    )
    assert (found.status == OK).all() and np.abs(
        found.joint_angles - angles
    ).max() < 0.02
    turned = angles.copy()
    straight = np.zeros_like(angles)
    turned[:, 0] += 2 * np.pi
    found = find_joint_targets(
        robot, position, rotation, np.zeros((len(position), 6)), turned
    )
    kept = found.status == OK
    assert kept.any() and np.abs(found.joint_angles - turned)[kept].max() < 0.02
    assert set(found.status[~kept]) <= {OUTSIDE_LIMITS}
    found = find_joint_targets(
        robot, position, rotation, np.zeros((len(position), 6)), straight
    )
    assert (
        set(found.status) <= {OTHER_POSTURE, UNREACHABLE, OUTSIDE_LIMITS}
        and OTHER_POSTURE in found.status
    )


def test_a_posture_behind_a_singular_one_is_another_however_near():
    """The wrist bends by as little to the one side as to the other."""
    robot = make_robot("gp180")
    angles = np.tile(robot.robot.joint_limits.mean(axis=1) + BENT, (2, 1))
    angles[:, 4] = np.radians([5.0, 15.0])
    reported = robot.robot.reported_angles(angles)
    stated = angles.copy()
    stated[:, 4] = np.radians([15.0, -1.0])
    found = find_joint_targets(
        robot,
        *compute_nominal_poses(robot.robot, reported),
        np.zeros((len(reported), 6)),
        robot.robot.reported_angles(stated),
    )
    assert found.status.tolist() == [OK, OTHER_POSTURE]


@pytest.mark.parametrize("name", ["kuka", "iiwa14"])
def test_random_paths_never_swing(name):
    """Limits of 170 to 350 degrees either way: no step above the rule."""
    draws = np.random.default_rng(5)
    whole = 0
    for _ in range(5):
        robot = make_robot(name)
        half = np.radians(draws.uniform(170.0, 350.0, robot.robot.joints))
        robot = replace(
            robot,
            robot=replace(robot.robot, joint_limits=np.stack([-half, half], axis=1)),
        )
        walk = draws.uniform(-half, half) + np.cumsum(
            draws.normal(0.0, 0.06, (10, len(half))), axis=0
        )
        position, rotation = compute_nominal_poses(
            robot.robot, robot.robot.reported_angles(walk.clip(-half, half))
        )
        found = find_joint_targets(
            robot, position, rotation, np.zeros((len(position), 6))
        )
        good = found.status == OK
        whole += good.all()
        assert not find_large_steps(
            robot.robot, position[good], rotation[good], found.joint_angles[good]
        )
    assert whole >= 4
