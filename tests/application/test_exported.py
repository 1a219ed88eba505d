"""The calibrated robot as files: what a robot file can hold, and what it leaves out."""

from dataclasses import replace

import numpy as np
import pytest
from analysed_robots import analysed
from made_calibrated import make_calibrated_robot, plain_estimate, plain_model

from elastocal.application.calibrated import (
    calibrate_by_model,
    predict_poses,
    remove_effects,
)
from elastocal.application.exported import (
    compute_left_out_displacements_m,
    fold_effects,
)
from elastocal.effects.catalogue import candidates_on
from elastocal.mechanics.robot_file import describe_robot, parse_robot
from elastocal.mechanics.sites import build_sites

GEOMETRY = (
    "joint_offset@2",
    "joint_offset@4",
    "link_geometry@1",
    "link_geometry@2",
    "link_geometry@3",
    "link_geometry@4",
)


def draw_states(robot, count=20):
    """Reported angles within the limits, and a load for each."""
    stream = np.random.default_rng(5)
    low, high = robot.joint_limits.T
    angles = low + (high - low) * stream.random((count, robot.joints))
    wrench = stream.standard_normal((count, 6)) * 50.0
    return robot.reported_angles(angles), wrench


def calibrate_by_file(robot):
    """The calibrated robot that a robot file alone describes, with its springs and
    weights and without effects."""
    model = plain_model(robot)
    coefficients = []
    for effect in model.effects:
        is_compliance = effect.effect == "joint_compliance"
        zeros = np.zeros(len(effect.parameters))
        coefficients.append(robot.compliance if is_compliance else zeros)
    count = sum(len(values) for values in coefficients)
    estimate = plain_estimate(model, coefficients)
    noise = make_calibrated_robot(robot).noise
    return calibrate_by_model(robot, model, estimate, np.zeros((count, count)), noise)


@pytest.mark.parametrize(
    ("name", "additional"),
    [
        ("gp180", ()),
        ("iiwa14", ()),
        ("fanuc_static", ()),
        ("fanuc_cpa", ()),
        ("ur10", ()),
        ("abb", ()),
        ("fanuc_cpa", ("transmission_ratio@1",)),
        ("fanuc_cpa", ("transmission_ratio@3",)),
    ],
)
def test_poses_of_a_robot_file_under_load_are_those_of_the_calibrated_robot(
    name, additional
):
    robot = analysed(name)
    candidates = candidates_on(build_sites(robot))
    keys = (*GEOMETRY, "link_geometry@6", *additional)
    calibrated = make_calibrated_robot(
        robot, *(key for key in keys if key in candidates), size=1.0
    )
    folded = fold_effects(calibrated)
    assert folded.left_out == ()
    commands, wrench = draw_states(robot)
    robot_of_file = parse_robot(describe_robot(folded.robot))
    from_file = predict_poses(calibrate_by_file(robot_of_file), commands, wrench)
    expected = predict_poses(calibrated, commands, wrench)
    np.testing.assert_allclose(from_file[0], expected[0], atol=1e-9)
    np.testing.assert_allclose(from_file[1], expected[1], atol=1e-9)


def test_effects_that_a_robot_file_cannot_hold_are_left_out_and_change_nothing_else():
    keys = ["lost_motion@2", "transmission_harmonic@1[orders 1-2]"]
    calibrated = make_calibrated_robot(analysed("gp180"), *GEOMETRY, *keys)
    folded = fold_effects(calibrated)
    assert [calibrated.model.effects[number].key for number in folded.left_out] == keys
    commands, wrench = draw_states(calibrated.robot)
    reduced = remove_effects(calibrated, set(folded.left_out))
    from_file, _ = predict_poses(calibrate_by_file(folded.robot), commands, wrench)
    without_effects, _ = predict_poses(reduced, commands, wrench)
    with_effects, _ = predict_poses(calibrated, commands, wrench)
    np.testing.assert_allclose(from_file, without_effects, atol=1e-9)
    displacements = compute_left_out_displacements_m(calibrated, commands, wrench)
    expected = np.linalg.norm(with_effects - without_effects, axis=1)
    np.testing.assert_allclose(displacements, expected)
    assert displacements.max() > 1e-6


def test_a_joint_without_compliance_is_written_as_a_value_that_is_read_again():
    robot = analysed("gp180")
    calibrated = calibrate_by_file(robot)
    rigid = tuple(
        np.zeros(6) if effect.effect == "joint_compliance" else values
        for effect, values in zip(
            calibrated.model.effects, calibrated.estimate.coefficients, strict=True
        )
    )
    estimate = replace(calibrated.estimate, coefficients=rigid)
    folded = fold_effects(replace(calibrated, estimate=estimate)).robot
    written = describe_robot(folded)["compliance_urad_per_Nm"]
    assert written == pytest.approx([1e-6] * 6)
    assert parse_robot(describe_robot(folded)).compliance_known
