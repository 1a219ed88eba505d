"""A robot file says of the calibrated robot what it can, exactly, and names what it cannot."""

from dataclasses import replace

import numpy as np
import pytest
from analysed_robots import analysed
from made_calibrated import made_calibrated, plain_estimate, plain_model

from elastocal.application.calibrated import OperatingConditions, calibrate_by_model, forward
from elastocal.application.calibrated_geometry import fold_effects
from elastocal.effects.catalogue import candidates_on
from elastocal.mechanics.robot_file import document_of, robot_from_document
from elastocal.mechanics.sites import sites_of

GEOMETRY = ("joint_offset@2", "joint_offset@4", "link_geometry@1", "link_geometry@2", "link_geometry@3", "link_geometry@4")


def draw_states(robot, count=25):
    draws = np.random.default_rng(5)
    low, high = robot.joint_limits.T
    angles = low + (high - low) * draws.random((count, robot.joints))
    return robot.reported_angles(angles), OperatingConditions(draws.standard_normal((count, 6)) * 50.0)


def read_file_model(robot):
    """The calibrated robot that a robot file alone describes: its springs, its weight, no effect."""
    model = plain_model(robot)
    values = [robot.compliance if e.effect == "joint_compliance" else np.zeros(len(e.parameters)) for e in model.effects]
    count = sum(len(value) for value in values)
    noise = made_calibrated(robot).noise
    return calibrate_by_model(robot, model, plain_estimate(model, values), np.zeros((count, count)), noise)


@pytest.mark.parametrize("name", ["gp180", "iiwa14", "fanuc_static", "fanuc_cpa", "ur10", "abb"])
def test_poses_under_load_are_those_of_the_calibrated_robot(name):
    robot = analysed(name)
    known = candidates_on(sites_of(robot))
    calibrated = made_calibrated(robot, *(key for key in (*GEOMETRY, "link_geometry@6") if key in known), size=1.0)
    found = fold_effects(calibrated)
    assert found.left_out == ()
    angles, operating = draw_states(robot)
    through_file = robot_from_document(document_of(found.robot))
    for mine, theirs in zip(
        forward(read_file_model(through_file), angles, operating), forward(calibrated, angles, operating), strict=True
    ):
        np.testing.assert_allclose(mine, theirs, atol=1e-9)


@pytest.mark.parametrize("key", ["transmission_ratio@3", "transmission_ratio@1"])
def test_ratios_go_into_what_the_controllers_angles_mean(key):
    calibrated = made_calibrated(analysed("fanuc_cpa"), key, size=1.0)
    found = fold_effects(calibrated)
    assert found.left_out == ()
    angles, operating = draw_states(calibrated.robot)
    mine, theirs = (forward(each, angles, operating)[0] for each in (read_file_model(found.robot), calibrated))
    np.testing.assert_allclose(mine, theirs, atol=1e-9)


def test_what_a_robot_file_cannot_say_is_left_out_and_changes_nothing_else():
    calibrated = made_calibrated(analysed("gp180"), *GEOMETRY, "lost_motion@2", "transmission_harmonic@1[orders 1-2]")
    found = fold_effects(calibrated)
    keys = [calibrated.model.effects[number].key for number in found.left_out]
    assert keys == ["lost_motion@2", "transmission_harmonic@1[orders 1-2]"]
    bare = tuple(0 * v if n in found.left_out else v for n, v in enumerate(calibrated.estimate.coefficients))
    without = replace(calibrated, estimate=replace(calibrated.estimate, coefficients=bare))
    angles, operating = draw_states(calibrated.robot)
    mine, theirs = (forward(each, angles, operating)[0] for each in (read_file_model(found.robot), without))
    np.testing.assert_allclose(mine, theirs, atol=1e-9)
