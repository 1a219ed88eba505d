"""The calibrated robot as files: what a robot file can say, and what it leaves out."""

import numpy as np
import pytest
from analysed_robots import analysed
from made_calibrated import made_calibrated, plain_estimate, plain_model

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
from elastocal.mechanics.robot_file import document_of, robot_from_document
from elastocal.mechanics.sites import sites_of

GEOMETRY = (
    "joint_offset@2",
    "joint_offset@4",
    "link_geometry@1",
    "link_geometry@2",
    "link_geometry@3",
    "link_geometry@4",
)


def draw_states(robot, count=20):
    draws = np.random.default_rng(5)
    low, high = robot.joint_limits.T
    angles = low + (high - low) * draws.random((count, robot.joints))
    wrench = draws.standard_normal((count, 6)) * 50.0
    return robot.reported_angles(angles), wrench


def read_file_model(robot):
    """The calibrated robot that a robot file alone describes: its springs, its weight,
    no effect."""
    model = plain_model(robot)
    values = [
        robot.compliance
        if e.effect == "joint_compliance"
        else np.zeros(len(e.parameters))
        for e in model.effects
    ]
    count = sum(len(value) for value in values)
    noise = made_calibrated(robot).noise
    return calibrate_by_model(
        robot, model, plain_estimate(model, values), np.zeros((count, count)), noise
    )


@pytest.mark.parametrize(
    ("name", "more"),
    [
        *(
            (name, ())
            for name in ("gp180", "iiwa14", "fanuc_static", "fanuc_cpa", "ur10", "abb")
        ),
        *(("fanuc_cpa", (f"transmission_ratio@{joint}",)) for joint in (1, 3)),
    ],
)
def test_poses_of_a_robot_file_under_load_are_those_of_the_calibrated_robot(name, more):
    robot = analysed(name)
    known = candidates_on(sites_of(robot))
    calibrated = made_calibrated(
        robot,
        *(key for key in (*GEOMETRY, "link_geometry@6", *more) if key in known),
        size=1.0,
    )
    found = fold_effects(calibrated)
    assert found.left_out == ()
    angles, wrench = draw_states(robot)
    through_file = robot_from_document(document_of(found.robot))
    for mine, theirs in zip(
        predict_poses(read_file_model(through_file), angles, wrench),
        predict_poses(calibrated, angles, wrench),
        strict=True,
    ):
        np.testing.assert_allclose(mine, theirs, atol=1e-9)


def test_what_a_robot_file_cannot_say_is_left_out_and_changes_nothing_else():
    keys = ["lost_motion@2", "transmission_harmonic@1[orders 1-2]"]
    calibrated = made_calibrated(analysed("gp180"), *GEOMETRY, *keys)
    found = fold_effects(calibrated)
    assert [calibrated.model.effects[number].key for number in found.left_out] == keys
    angles, wrench = draw_states(calibrated.robot)
    bare = remove_effects(calibrated, set(found.left_out))
    ends = [
        predict_poses(each, angles, wrench)[0]
        for each in (read_file_model(found.robot), bare, calibrated)
    ]
    np.testing.assert_allclose(ends[0], ends[1], atol=1e-9)
    off = compute_left_out_displacements_m(calibrated, angles, wrench)
    np.testing.assert_allclose(off, np.linalg.norm(ends[2] - ends[1], axis=1))
    assert off.max() > 1e-6
