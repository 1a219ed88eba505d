"""Boxes and lines of sight."""

import numpy as np
import pytest
from analysed_robots import analysed
from made_surveys import made_survey

from elastocal.application.inverse_kinematics import compute_reach_m
from elastocal.application.planning.cell import (
    COLUMN_SHARE,
    Cell,
    check_configurations,
    sample_links,
)
from elastocal.campaigns.campaign import Target
from elastocal.mechanics.kinematics import poses

EVERYWHERE = np.array([[-5.0, 5.0], [-5.0, 5.0], [-5.0, 5.0]])


@pytest.fixture(scope="module")
def survey():
    return made_survey()


@pytest.fixture(scope="module")
def angles(survey):
    low, high = survey.robot.joint_limits.T
    return low + (high - low) * np.random.default_rng(1).random((300, 6))


def test_nothing_is_allowed_in_a_box_around_everything_and_all_far_from_it(
    survey, angles
):
    assert not check_configurations(
        Cell((EVERYWHERE,), None, 0.05), survey.robot, survey.targets, angles
    )["boxes"].any()
    assert check_configurations(
        Cell((EVERYWHERE + 20.0,), None, 0.05), survey.robot, survey.targets, angles
    )["boxes"].all()


def test_a_target_behind_the_arm_is_hidden_and_one_before_it_is_seen(survey, angles):
    """A tracker at each end of the line from the middle of the arm through the
    target."""
    target, _ = poses(
        survey.robot.chain,
        survey.robot.model_angles(angles),
        survey.robot.chain.end_effector,
    )
    elbow = sample_links(survey.robot, survey.robot.model_angles(angles))[8 * 2]
    out = (target - elbow) / np.linalg.norm(target - elbow, axis=1, keepdims=True)
    for number in np.flatnonzero(np.linalg.norm(target - elbow, axis=1) > 0.4)[::60]:
        behind = Cell((), elbow[number] - 3.0 * out[number], 0.08)
        assert not check_configurations(
            behind, survey.robot, survey.targets, angles[number : number + 1]
        )["sight"][0]
    lone = Cell((), np.array([0.0, 0.0, 500.0]), 1e-6)
    assert check_configurations(lone, survey.robot, survey.targets, angles)[
        "sight"
    ].all()


@pytest.mark.parametrize("name", ["abb", "iiwa14"])
def test_neither_forearm_nor_target_is_below_the_floor_or_in_the_column(name):
    robot = analysed(name)
    draws = np.random.default_rng(1)
    low, high = robot.joint_limits.T
    reported = robot.reported_angles(
        low + (high - low) * draws.random((2000, robot.joints))
    )
    end = robot.chain.end_effector.name
    column = COLUMN_SHARE * compute_reach_m(robot)
    targets = (Target("A", end, (0.0, 0.0, 0.2)),)
    free = Cell((), None, 0.02)
    angles = robot.model_angles(reported)
    at, turned = poses(robot.chain, angles, robot.chain.end_effector)
    tip = at + turned @ [0.0, 0.0, 0.2]
    forearm = sample_links(robot, angles, 2)
    low_ones = (tip[:, 2] < 0.0) | (forearm[..., 2] < 0.0).any(axis=0)
    found = check_configurations(
        Cell((), None, 0.02, 0.0, column), robot, targets, reported
    )
    assert (
        low_ones.sum() > 50
        and not (found["floor"] & low_ones).any()
        and found["floor"].sum() > 200
    )
    # Half a metre below, more is allowed.
    assert (
        check_configurations(Cell((), None, 0.02, -0.5), robot, targets, reported)[
            "floor"
        ].sum()
        > found["floor"].sum()
    )
    assert all(
        each.all()
        for each in check_configurations(free, robot, targets, reported).values()
    )
    shoulder = sample_links(robot, angles, 1)[0, :, 2]
    inside = (
        (np.linalg.norm(forearm[..., :2], axis=-1) < column)
        & (forearm[..., 2] < shoulder)
    ).any(axis=0)
    assert (
        inside.any()
        and not (found["column"] & inside).any()
        and found["column"].mean() > 0.5
    )
