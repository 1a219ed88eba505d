"""A sign is named where turning it lets readings fit that were absurd, and nowhere else."""

from dataclasses import replace

import numpy as np
import pytest
from made_campaigns import Plan, made, with_other_compliances

from elastocal.faults.wrong_sign import find


@pytest.fixture(scope="module", params=["base", "tracker"])
def campaign(request, fanuc):
    return made(fanuc, 1, Plan(poses=20, tracker=request.param == "tracker"), with_other_compliances(fanuc, 1, 0.3))


@pytest.mark.parametrize("joint", range(6))
def test_a_joint_counted_the_other_way_round_is_named(campaign, joint):
    angles = campaign.readings.joint_angles * (1.0 - 2.0 * np.eye(6)[joint])
    (fault,) = find(campaign, replace(campaign.readings, joint_angles=angles))
    assert (fault.name, fault.joints, fault.decisive) == ("wrong_sign", (joint + 1,), True)
    before, after = fault.evidence
    assert before > 0.02 and after < 1e-3


@pytest.mark.parametrize(("sign", "words"), [(1.0, "taken from"), (-1.0, "added to")])
def test_a_joint_counted_from_its_neighbour_is_named_with_it(campaign, sign, words):
    angles = campaign.readings.joint_angles.copy()
    angles[:, 2] += sign * angles[:, 1]
    (fault,) = find(campaign, replace(campaign.readings, joint_angles=angles))
    assert fault.joints == (2, 3)
    assert words in fault.detail


def test_two_joints_counted_the_other_way_round_are_named_together(campaign):
    angles = campaign.readings.joint_angles * [1, -1, 1, 1, -1, 1]
    (fault,) = find(campaign, replace(campaign.readings, joint_angles=angles))
    assert fault.joints == (2, 5)


def test_the_sign_is_that_of_the_column_of_the_file(fanuc):
    """Where the controller counts from elsewhere, turning the column is not turning the angle of the model."""
    reported_matrix = np.diag([1.0, 1.0, -1.0, 1.0, 1.0, 1.0])
    robot = replace(fanuc, reported_matrix=reported_matrix, reported_offset=np.radians([0, -40, 60, 0, 0, 0]))
    campaign = made(robot, 3, Plan(poses=20))
    reported = (campaign.readings.joint_angles - robot.reported_offset) @ reported_matrix
    reported[:, 2] *= -1
    angles = reported @ reported_matrix + robot.reported_offset
    (fault,) = find(campaign, replace(campaign.readings, joint_angles=angles))
    assert fault.joints == (3,)


def test_a_joint_that_is_still_in_most_poses_is_named(fanuc):
    campaign = made(fanuc, 4, Plan(poses=40, tracker=True, oriented=False), moving={2: 3})
    angles = campaign.readings.joint_angles * [1, 1, -1, 1, 1, 1]
    (fault,) = find(campaign, replace(campaign.readings, joint_angles=angles))
    assert fault.joints == (3,)


def test_orientations_turned_round_are_named(campaign):
    (fault,) = find(campaign, replace(campaign.readings, rotation_vector=-campaign.readings.rotation_vector))
    assert fault.joints == ()
    assert "rotation vectors" in fault.detail


def test_loads_turned_round_are_named(campaign):
    (fault,) = find(campaign, replace(campaign.readings, wrench=-campaign.readings.wrench))
    assert fault.joints == ()
    assert "loads" in fault.detail
    assert -2.0 < fault.parameters[0].value < -0.5


def test_loads_turned_round_are_named_without_unloaded_readings(fanuc):
    campaign = made(fanuc, 5, Plan(poses=40, loads=1, tracker=True, oriented=False))
    readings = campaign.readings.select(campaign.readings.load > 0)
    assert find(campaign, readings) == []
    (fault,) = find(campaign, replace(readings, wrench=-readings.wrench))
    assert "loads" in fault.detail
