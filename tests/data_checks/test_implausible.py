"""Measurements that no robot of this kind made say so; those of a robot that only lacks much do not."""

from dataclasses import replace

import pytest
from made_campaigns import Plan, made, with_geometric_errors

from elastocal.data_checks.implausible import find


@pytest.mark.parametrize("tracker", [True, False])
def test_measurements_of_another_robot_are_named(fanuc, kuka, tracker):
    campaign = made(fanuc, 1, Plan(poses=20, tracker=tracker))
    (fault,) = find(replace(campaign, robot=kuka), campaign.measurements)
    assert (fault.name, fault.decisive) == ("implausible_measurements", True)
    assert fault.parameters[0].value > 0.1 and "\n" not in fault.detail


@pytest.mark.parametrize("tracker", [True, False])
def test_a_robot_with_errors_of_centimetres_is_still_that_robot(fanuc, tracker):
    campaign = made(fanuc, 1, Plan(poses=20, tracker=tracker), with_geometric_errors(fanuc, 1, 0.01), 5e-3, sag=5e-3)
    assert find(campaign, campaign.measurements) == []
