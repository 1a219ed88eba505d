"""The calibrated robot: what it keeps, where it takes the end effector, and how sure
that is."""

from dataclasses import replace

import numpy as np
from made_calibrated import USUAL, made_calibrated, plain_estimate, plain_model
from scipy.spatial.transform import Rotation
from support import robot_of
from synthetic import NOISE, made_states

from elastocal.application.calibrated import (
    calibrate_by_model,
    compute_pose_sensitivities,
    predict_poses,
)
from elastocal.fitting.model import apply_step
from elastocal.mechanics.kinematics import pose_differences
from elastocal.mechanics.robot import Mass

ONE_JOINT = "Tz(0.5) Ry(q1) Tx(0.8) [hand]"


def test_what_belongs_to_the_set_up_or_goes_with_what_no_command_states_is_left_out_with_its_covariance(
    fanuc,
):
    keys = (
        "force_bias[base axes]",
        "joint_offset@2",
        "hysteresis@2",
        "frame_drift",
        "lost_motion@3",
        "nest_eccentricity",
    )
    model = plain_model(fanuc, *keys)
    rng = np.random.default_rng(1)
    counts = [len(effect.parameters) + len(effect.shapes) for effect in model.effects]
    root = rng.standard_normal((sum(counts), sum(counts)))
    estimate = plain_estimate(
        model, [rng.standard_normal(len(effect.parameters)) for effect in model.effects]
    )
    found = calibrate_by_model(fanuc, model, estimate, root @ root.T, NOISE)
    assert [effect.key for effect in found.model.effects] == [
        "joint_compliance",
        "joint_offset@2",
        "lost_motion@3",
    ]
    np.testing.assert_array_equal(
        found.estimate.coefficients[1], estimate.coefficients[2]
    )
    np.testing.assert_array_equal(found.estimate.shapes[2], estimate.shapes[5])
    starts = np.concatenate([[0], np.cumsum(counts)])
    rows = np.concatenate([np.arange(starts[n], starts[n + 1]) for n in (0, 2, 5)])
    np.testing.assert_array_equal(found.covariance, (root @ root.T)[np.ix_(rows, rows)])


def test_spring_and_weight_of_one_joint_are_in_equilibrium():
    """q + c tau(q') = q' with the torque where the arm has sagged to, not where it was
    sent."""
    robot = replace(
        robot_of(ONE_JOINT, [2e-5]), masses=(Mass(1, 20.0, (0.4, 0.0, 0.1), 0.1),)
    )
    found = made_calibrated(robot, identified=False, size=0.0)
    for q, force in ((0.3, 0.0), (-0.7, 300.0)):
        position, rotation = predict_poses(
            found, np.array([[q]]), np.array([[0, 0, force, 0, 0, 0.0]])
        )
        at = q
        for _ in range(100):
            weight = -20.0 * 9.80665
            # About y, r x F: z F_x - x F_z, with the lever of each force turned by the
            # angle.
            centre = 0.4 * np.cos(at) + 0.1 * np.sin(at)
            at = q + 2e-5 * (-centre * weight - 0.8 * np.cos(at) * force)
        assert abs(at - q) > 1e-4
        np.testing.assert_allclose(
            position[0], [0.8 * np.cos(at), 0, 0.5 - 0.8 * np.sin(at)], atol=1e-11
        )
        np.testing.assert_allclose(
            Rotation.from_matrix(rotation[0]).as_rotvec(), [0, at, 0], atol=1e-11
        )


def test_sensitivities_are_the_derivatives_of_the_poses_by_every_parameter(fanuc):
    found = made_calibrated(
        fanuc, *USUAL, "transmission_harmonic@2[orders 1-2]", relative_std=0.01
    )
    states = made_states(6, 2, seed=4)
    middle = predict_poses(found, states.joint_angles, states.wrench)
    sensitivities = compute_pose_sensitivities(
        found, states.joint_angles, states.wrench
    )
    for place, size in enumerate(np.sqrt(np.diag(found.covariance))):
        step = np.zeros(len(found.covariance))
        step[place] = 1e-2 * size
        moved = replace(found, estimate=apply_step(found.model, found.estimate, step))
        off = pose_differences(
            *predict_poses(moved, states.joint_angles, states.wrench), *middle
        )
        np.testing.assert_allclose(
            off,
            sensitivities @ step,
            rtol=1e-2,
            atol=1e-2 * np.abs(sensitivities @ step).max(),
        )
