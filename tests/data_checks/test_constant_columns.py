"""Columns that stand still while the robot moves, or the other way round, are named; what may stand still is not."""

from dataclasses import replace

import numpy as np
import pytest
from made_campaigns import Plan, made

from elastocal.data_checks.constant_columns import find


@pytest.fixture(scope="module", params=["base", "tracker"])
def campaign(request, fanuc):
    return made(fanuc, 1, Plan(poses=12, tracker=request.param == "tracker"))


@pytest.mark.parametrize(("kept", "words"), [((0, 0, 0), "x, y, z of"), ((1, 1, 0), "z of"), ((0, 1, 0), "x, z of")])
def test_positions_that_stand_still_are_named(campaign, kept, words):
    for value, same in ((0.0, "zero"), (1.5, "the same")):
        position = np.where(kept, campaign.measurements.position, value)
        (fault,) = find(campaign, replace(campaign.measurements, position=position))
        assert (fault.name, fault.decisive) == ("constant_columns", True)
        assert fault.detail.startswith(words) and f" {same} in all 12 poses" in fault.detail


def test_angles_that_stand_still_while_the_measurements_move_are_named(campaign):
    still = np.full_like(campaign.measurements.joint_angles, 0.4)
    (fault,) = find(campaign, replace(campaign.measurements, joint_angles=still))
    assert fault.detail.startswith("the joint angles are the same in all 12 poses")


def test_a_robot_that_moves_in_a_plane_may_have_a_constant_coordinate(fanuc):
    campaign = made(fanuc, 1, Plan(poses=12, noise=0.0, loads=0), moving={1: 0, 2: 0, 3: 0, 4: 0, 5: 0})
    assert np.ptp(campaign.measurements.position[campaign.measurements.target == 3, 2]) < 1e-9
    assert find(campaign, campaign.measurements) == []


def test_one_pose_read_again_and_again_is_no_fault(campaign):
    measurements, first = campaign.measurements, campaign.measurements.position[: len(campaign.targets)]
    position = first[measurements.target] + 1e-5 * measurements.pose[:, None]
    still = replace(measurements, joint_angles=np.full_like(measurements.joint_angles, 0.4), position=position)
    assert find(campaign, still) == []
