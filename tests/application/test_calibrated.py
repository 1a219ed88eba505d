"""Where a calibrated robot comes to rest, against the rigid robot, closed forms and draws of its parameters."""

from dataclasses import replace

import numpy as np
import pytest
from calibrated_robots import drawn_commands, made_calibrated

from elastocal.application.calibrated import Commands, forward, nominal_forward, prediction_covariance, unloaded
from elastocal.effects.catalogue import candidates_on
from elastocal.mechanics.kinematics import jacobians
from elastocal.mechanics.pose_differences import pose_differences
from elastocal.mechanics.sites import sites_of

# What each effect of the catalogue is a fault of, if not of the robot itself.
OF_INSTRUMENTS = {"tracker_scale", "nest_eccentricity", "force_bias", "force_scale", "force_misalignment", "application_point"}
OF_SETUP = {"frame_drift", "setup_step"}


@pytest.fixture(scope="module")
def with_effects():
    return made_calibrated("gp180", ("joint_offset", "link_geometry", "link_weight@2", "transmission_harmonic@1["))


@pytest.mark.parametrize("name", ["gp180", "fanuc", "wam"])
def test_candidates_say_whether_they_are_of_the_robot_or_of_what_measured_it(name):
    candidates = candidates_on(made_calibrated(name).model.sites).values()
    assert {c.effect for c in candidates if c.of_instruments} <= OF_INSTRUMENTS
    assert {c.effect for c in candidates if c.of_setup} <= OF_SETUP
    assert not [c.key for c in candidates if c.effect in OF_INSTRUMENTS and not c.of_instruments]


def test_effects_of_instruments_and_set_up_are_left_out_with_their_parameters():
    whole = made_calibrated("ur10", ("joint_offset@2", "tracker_scale", "frame_drift", "force_bias"))
    assert [e.effect for e in whole.model.effects if e.effect not in ("joint_compliance", "declared_weight")] == [
        "joint_offset"
    ]
    assert len(whole.covariance) == sum(len(e.parameters) + len(e.shapes) for e in whole.model.effects)


def test_a_stiff_robot_without_effects_or_load_is_the_rigid_one():
    stiff = made_calibrated("fanuc_static")
    stiff = replace(stiff, estimate=replace(stiff.estimate, coefficients=(np.zeros(6),)))
    commands = drawn_commands(stiff, 50)
    for found, nominal in zip(forward(stiff, commands), nominal_forward(stiff.robot, commands.joint_angles), strict=True):
        np.testing.assert_allclose(found, nominal, atol=1e-12)


def test_a_small_load_deflects_by_compliance_and_jacobian():
    robot = made_calibrated("ur10")
    robot = replace(robot, robot=replace(robot.robot, masses=()), model=replace(robot.model, sites=sites_of(robot.robot.chain)))
    robot = replace(robot, model=replace(robot.model, effects=robot.model.effects[:1]))
    robot = replace(robot, estimate=replace(robot.estimate, coefficients=robot.estimate.coefficients[:1], shapes=((),)))
    commands = drawn_commands(robot, 40, force=1e-3)
    angles = robot.robot.model_angles(commands.joint_angles)
    jacobian = jacobians(robot.robot.chain, angles, robot.robot.chain.end_effector)
    joints = robot.estimate.coefficients[0] * (jacobian.transpose(0, 2, 1) @ commands.wrench[..., None])[..., 0]
    expected = (jacobian @ joints[..., None])[..., 0]
    moved = pose_differences(*forward(robot, commands), *forward(robot, unloaded(commands.joint_angles)))
    np.testing.assert_allclose(moved, expected, atol=1e-4 * np.abs(expected).max())


def test_parts_of_a_long_list_are_as_single_commands(with_effects, monkeypatch):
    commands = drawn_commands(with_effects, 23)
    whole = forward(with_effects, commands), prediction_covariance(with_effects, commands)
    monkeypatch.setattr("elastocal.application.calibrated.STATES_AT_ONCE", 5)
    monkeypatch.setattr("elastocal.application.calibrated.observations_at_once", lambda *_: 4)
    parts = forward(with_effects, commands), prediction_covariance(with_effects, commands)
    np.testing.assert_allclose(parts[0][0], whole[0][0], atol=1e-14)
    np.testing.assert_allclose(parts[1], whole[1], rtol=1e-9, atol=1e-20)


def test_predicted_covariance_is_that_of_draws_of_the_parameters(with_effects):
    """1,500 draws: standard errors of the deviations are 1.8 %; the bound is five of them."""
    commands = drawn_commands(with_effects, 3)
    draws, deviations = np.random.default_rng(4), np.sqrt(np.diag(with_effects.covariance))
    sizes = [len(values) for values in with_effects.estimate.coefficients]
    poses = []
    for _ in range(1500):
        step = np.split(deviations * draws.standard_normal(len(deviations)), np.cumsum(sizes)[:-1])
        values = tuple(value + change for value, change in zip(with_effects.estimate.coefficients, step, strict=True))
        moved = replace(with_effects, estimate=replace(with_effects.estimate, coefficients=values))
        poses.append(pose_differences(*forward(moved, commands), *forward(with_effects, commands)))
    found = np.sqrt((np.array(poses) ** 2).mean(axis=0))
    predicted = np.sqrt(np.diagonal(prediction_covariance(with_effects, commands), axis1=1, axis2=2))
    np.testing.assert_allclose(found, predicted, rtol=0.1)


def test_covariates_that_are_not_stated_are_where_their_effects_do_nothing():
    robot = made_calibrated("fanuc", ("thermal_growth[temperature", "hysteresis@2"))
    assert robot.needing("temperature") == ["thermal_growth[temperature]"]
    assert robot.needing("approach") == ["hysteresis@2"]
    commands = drawn_commands(robot, 5)
    stated = replace(commands, temperature_c=np.full(5, 20.0), approach=np.zeros((5, 6)))
    np.testing.assert_array_equal(forward(robot, commands)[0], forward(robot, stated)[0])
    warm = replace(stated, temperature_c=np.full(5, 40.0))
    assert np.abs(forward(robot, warm)[0] - forward(robot, stated)[0]).max() > 1e-6


def test_commands_are_taken_apart_with_what_they_do_not_state():
    commands = Commands(np.arange(12.0).reshape(4, 3), np.zeros((4, 6)), time_s=np.arange(4.0))
    some = commands.at(np.array([2, 0]))
    assert (some.time_s == [2.0, 0.0]).all()
    assert some.approach is None
    assert len(some.with_angles(np.ones((2, 3)))) == 2
