"""Measurements that no robot of this kind made say so; those of a robot that only lacks much do not."""

from dataclasses import replace

import numpy as np
import pytest
from made_campaigns import Plan, made, with_geometric_errors

from elastocal.data_checks.implausible import find
from elastocal.data_checks.protocol import faults


@pytest.mark.parametrize("tracker", [True, False])
def test_measurements_of_another_robot_are_named(fanuc, kuka, tracker):
    campaign = made(fanuc, 1, Plan(poses=20, tracker=tracker))
    (fault,) = find(replace(campaign, robot=kuka), campaign.measurements)
    assert (fault.name, fault.decisive) == ("implausible_measurements", True)
    assert fault.parameters[0].value > 0.1 and "\n" not in fault.detail


@pytest.mark.parametrize("tracker", [True, False])
@pytest.mark.parametrize(("link_m", "joint_rad"), [(0.06, 0.0), (0.0, 0.2), (0.03, 0.12)])
def test_a_robot_that_is_off_by_decimetres_for_its_geometry_is_no_fault_of_the_data(fanuc, tracker, link_m, joint_rad):
    offset = joint_rad * np.array([0.0, 1.0, -1.0, 1.0, 1.0, 0.0])
    campaign = made(fanuc, 1, Plan(poses=20, tracker=tracker), with_geometric_errors(fanuc, 1, link_m), offset)
    assert not [fault for fault in faults(campaign, campaign.measurements) if fault.decisive]


@pytest.mark.parametrize("tracker", [True, False])
def test_a_robot_with_errors_of_centimetres_is_still_that_robot(fanuc, tracker):
    campaign = made(fanuc, 1, Plan(poses=20, tracker=tracker), with_geometric_errors(fanuc, 1, 0.01), 5e-3, sag=5e-3)
    assert find(campaign, campaign.measurements) == []
