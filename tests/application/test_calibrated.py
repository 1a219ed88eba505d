"""The calibrated robot: its effects, its poses under load, and their sensitivities."""

from dataclasses import replace

import numpy as np
import pytest
from made_calibrated import USUAL, make_calibrated_robot, plain_estimate, plain_model
from scipy.spatial.transform import Rotation
from support import robot_of
from synthetic import NOISE, make_states

from elastocal.application.calibrated import (
    calibrate_by_model,
    compute_pose_sensitivities,
    predict_poses,
)
from elastocal.fitting.model import apply_step
from elastocal.mechanics.kinematics import compute_pose_differences
from elastocal.mechanics.robot import Mass

ONE_JOINT = "Tz(0.5) Ry(q1) Tx(0.8) [hand]"


def test_effects_that_no_command_contains_are_left_out_with_their_covariance(fanuc):
    model = plain_model(
        fanuc,
        "force_bias[base axes]",
        "joint_offset@2",
        "hysteresis@2",
        "frame_drift",
        "lost_motion@3",
        "nest_eccentricity",
    )
    stream = np.random.default_rng(1)
    counts = [len(effect.parameters) + len(effect.shapes) for effect in model.effects]
    root = stream.standard_normal((sum(counts), sum(counts)))
    covariance = root @ root.T
    coefficients = [
        stream.standard_normal(len(effect.parameters)) for effect in model.effects
    ]
    estimate = plain_estimate(model, coefficients)
    calibrated = calibrate_by_model(fanuc, model, estimate, covariance, NOISE)
    kept = [effect.key for effect in calibrated.model.effects]
    assert kept == ["joint_compliance", "joint_offset@2", "lost_motion@3"]
    np.testing.assert_array_equal(
        calibrated.estimate.coefficients[1], estimate.coefficients[2]
    )
    np.testing.assert_array_equal(calibrated.estimate.shapes[2], estimate.shapes[5])
    ends = np.cumsum(counts)
    indices = [np.arange(ends[n] - counts[n], ends[n]) for n in (0, 2, 5)]
    rows = np.concatenate(indices)
    np.testing.assert_array_equal(calibrated.covariance, covariance[np.ix_(rows, rows)])


@pytest.mark.parametrize(("command", "force"), [(0.3, 0.0), (-0.7, 300.0)])
def test_spring_and_weight_of_one_joint_are_in_equilibrium(command, force):
    """q + c tau(q') = q' with the torque at the angle q' to which the arm has sagged,
    not at the commanded one."""
    weight = Mass(1, 20.0, (0.4, 0.0, 0.1), 0.1)
    robot = replace(robot_of(ONE_JOINT, [2e-5]), masses=(weight,))
    calibrated = make_calibrated_robot(robot, identified=False, size=0.0)
    wrench = np.array([[0, 0, force, 0, 0, 0.0]])
    position, rotation = predict_poses(calibrated, np.array([[command]]), wrench)
    angle = command
    for _ in range(100):
        # Torque about y, z F_x - x F_z, of the weight and of the load, whose levers turn
        # with the joint.
        centre = 0.4 * np.cos(angle) + 0.1 * np.sin(angle)
        torque = centre * 20.0 * 9.80665 - 0.8 * np.cos(angle) * force
        angle = command + 2e-5 * torque
    assert abs(angle - command) > 1e-4
    hand = [0.8 * np.cos(angle), 0, 0.5 - 0.8 * np.sin(angle)]
    rotation_vector = Rotation.from_matrix(rotation[0]).as_rotvec()
    np.testing.assert_allclose(position[0], hand, atol=1e-11)
    np.testing.assert_allclose(rotation_vector, [0, angle, 0], atol=1e-11)


def test_sensitivities_are_the_derivatives_of_the_poses_by_every_parameter(fanuc):
    calibrated = make_calibrated_robot(
        fanuc, *USUAL, "transmission_harmonic@2[orders 1-2]", relative_std=0.01
    )
    states = make_states(6, 2, seed=4)
    commands = states.joint_angles, states.wrench
    pose = predict_poses(calibrated, *commands)
    sensitivities = compute_pose_sensitivities(calibrated, *commands)
    for number, size in enumerate(np.sqrt(np.diag(calibrated.covariance))):
        step = np.zeros(len(calibrated.covariance))
        step[number] = 1e-2 * size
        estimate = apply_step(calibrated.model, calibrated.estimate, step)
        stepped_pose = predict_poses(replace(calibrated, estimate=estimate), *commands)
        expected = sensitivities @ step
        np.testing.assert_allclose(
            compute_pose_differences(*stepped_pose, *pose),
            expected,
            rtol=1e-2,
            atol=1e-2 * np.abs(expected).max(),
        )
