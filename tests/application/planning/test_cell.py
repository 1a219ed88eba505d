"""Boxes, floor, column and lines of sight."""

import numpy as np
import pytest
from analysed_robots import analysed
from made_surveys import make_survey

from elastocal.application.inverse_kinematics import compute_reach_m
from elastocal.application.planning.cell import (
    COLUMN_SHARE,
    Cell,
    build_cell,
    check_configurations,
    sample_links,
)
from elastocal.campaigns.campaign import Target
from elastocal.mechanics.kinematics import compute_poses

EVERYWHERE = np.array([[-5.0, 5.0], [-5.0, 5.0], [-5.0, 5.0]])


@pytest.fixture(scope="module")
def survey():
    return make_survey()


@pytest.fixture(scope="module")
def angles(survey):
    low, high = survey.robot.joint_limits.T
    return low + (high - low) * np.random.default_rng(1).random((300, 6))


def check(cell, survey, angles):
    return check_configurations(cell, survey.robot, survey.targets, angles)


def test_nothing_is_allowed_in_a_box_around_everything_and_all_far_from_it(
    survey, angles
):
    assert not check(Cell((EVERYWHERE,), None, 0.05), survey, angles)["boxes"].any()
    far_away = EVERYWHERE + 20.0
    assert check(Cell((far_away,), None, 0.05), survey, angles)["boxes"].all()


def test_a_target_behind_the_arm_is_hidden(survey, angles):
    """The tracker is on the line from the target through the elbow."""
    robot = survey.robot
    chain_angles = robot.model_angles(angles)
    target, _ = compute_poses(robot.chain, chain_angles, robot.chain.end_effector)
    elbow = sample_links(robot, chain_angles)[8 * 2]
    distance = np.linalg.norm(target - elbow, axis=1, keepdims=True)
    direction = (target - elbow) / distance
    for number in np.flatnonzero(distance > 0.4)[::60]:
        cell = Cell((), elbow[number] - 3.0 * direction[number], 0.08)
        assert not check(cell, survey, angles[number : number + 1])["sight"][0]


def test_no_thin_link_hides_a_target_from_a_tracker_above(survey, angles):
    cell = Cell((), np.array([0.0, 0.0, 500.0]), 1e-6)
    assert check(cell, survey, angles)["sight"].all()


@pytest.fixture(params=["abb", "iiwa14"])
def robot(request):
    return analysed(request.param)


@pytest.fixture
def reported(robot):
    low, high = robot.joint_limits.T
    shares = np.random.default_rng(1).random((2000, robot.joints))
    return robot.reported_angles(low + (high - low) * shares)


def check_with_target(cell, robot, reported):
    """Check configurations with a target 0.2 m beyond the end effector."""
    target = Target("A", robot.chain.end_effector.name, (0.0, 0.0, 0.2))
    return check_configurations(cell, robot, (target,), reported)


def test_neither_forearm_nor_target_is_below_the_floor(robot, reported):
    angles = robot.model_angles(reported)
    position, rotation = compute_poses(robot.chain, angles, robot.chain.end_effector)
    height = (position + rotation @ [0.0, 0.0, 0.2])[:, 2]
    forearm = sample_links(robot, angles, 2)
    is_below = (height < 0.0) | (forearm[..., 2] < 0.0).any(axis=0)
    above = check_with_target(Cell((), None, 0.02, 0.0), robot, reported)["floor"]
    assert is_below.sum() > 50
    assert not (above & is_below).any() and above.sum() > 200
    # More configurations are allowed above a floor that is half a metre lower.
    lower_floor = Cell((), None, 0.02, -0.5)
    above_lower_floor = check_with_target(lower_floor, robot, reported)["floor"]
    assert above_lower_floor.sum() > above.sum()


def test_the_forearm_is_outside_the_column(robot, reported):
    angles = robot.model_angles(reported)
    column_m = COLUMN_SHARE * compute_reach_m(robot)
    forearm = sample_links(robot, angles, 2)
    shoulder_height = sample_links(robot, angles, 1)[0, :, 2]
    distance = np.linalg.norm(forearm[..., :2], axis=-1)
    is_inside = (distance < column_m) & (forearm[..., 2] < shoulder_height)
    is_inside = is_inside.any(axis=0)
    cell = Cell((), None, 0.02, 0.0, column_m)
    outside = check_with_target(cell, robot, reported)["column"]
    assert is_inside.any()
    assert not (outside & is_inside).any() and outside.mean() > 0.5


def test_an_empty_cell_allows_everything(robot, reported):
    constraints = check_with_target(Cell((), None, 0.02), robot, reported)
    assert all(is_met.all() for is_met in constraints.values())


def test_a_cell_of_a_robot_grows_with_its_reach(kuka):
    reach_m = compute_reach_m(kuka)
    cell = build_cell(kuka)
    assert cell.radius_m == pytest.approx(0.04 * reach_m)
    assert cell.column_m == pytest.approx(0.1 * reach_m)
    assert (cell.boxes, cell.tracker_m, cell.floor_m) == ((), None, 0.0)
