"""Boxes and lines of sight."""

import numpy as np
import pytest
from made_surveys import made_survey

from elastocal.application.planning.cell import Cell, find_allowed, link_points
from elastocal.mechanics.kinematics import poses

EVERYWHERE = np.array([[-5.0, 5.0], [-5.0, 5.0], [-5.0, 5.0]])


@pytest.fixture(scope="module")
def survey():
    return made_survey()


@pytest.fixture(scope="module")
def angles(survey):
    low, high = survey.robot.joint_limits.T
    return low + (high - low) * np.random.default_rng(1).random((300, 6))


def test_nothing_is_allowed_in_a_box_around_everything_and_all_far_from_it(survey, angles):
    assert not find_allowed(Cell((EVERYWHERE,), None, 0.05), survey.robot, survey.targets, angles)["boxes"].any()
    assert find_allowed(Cell((EVERYWHERE + 20.0,), None, 0.05), survey.robot, survey.targets, angles)["boxes"].all()


def test_a_target_behind_the_arm_is_hidden_and_one_before_it_is_seen(survey, angles):
    """A tracker at each end of the line from the middle of the arm through the target."""
    target, _ = poses(survey.robot.chain, survey.robot.model_angles(angles), survey.robot.chain.end_effector)
    elbow = link_points(survey.robot, survey.robot.model_angles(angles))[8 * 2]
    out = (target - elbow) / np.linalg.norm(target - elbow, axis=1, keepdims=True)
    for number in range(0, 300, 60):
        if np.linalg.norm(target[number] - elbow[number]) < 0.4:
            continue
        behind = Cell((), elbow[number] - 3.0 * out[number], 0.08)
        assert not find_allowed(behind, survey.robot, survey.targets, angles[number : number + 1])["sight"][0]
    lone = Cell((), np.array([0.0, 0.0, 500.0]), 1e-6)
    assert find_allowed(lone, survey.robot, survey.targets, angles)["sight"].all()
