"""Faults are looked for each behind those that make it meaningless; what is only wrong with the model is none."""

from dataclasses import replace

import numpy as np
import pytest
from made_campaigns import Plan, made, with_geometric_errors, with_other_compliances

from elastocal.data_checks.catalogue import fault_modules, faults

PLANS = {
    "base": Plan(poses=10, loads=2),
    "tracker": Plan(poses=15, tracker=True),
    "positions": Plan(poses=20, tracker=True, oriented=False, loads=1, repeats=2),
    "few poses": Plan(poses=8, loads=2),
    "small loads": Plan(poses=10, loads=2, force=20.0),
    "no noise": Plan(poses=10, loads=2, noise=0.0),
}


# Each plan with a seed of its own.
@pytest.mark.parametrize(("seed", "plan"), list(enumerate(PLANS)))
def test_no_fault_is_found_where_the_model_is_right(fanuc, plan, seed):
    campaign = made(fanuc, seed, PLANS[plan])
    assert faults(campaign, campaign.measurements) == ()


@pytest.mark.parametrize(("seed", "plan"), list(enumerate(PLANS)))
def test_nothing_decisive_is_found_where_the_model_lacks_something(kuka, plan, seed):
    """Springs, zeros, a sag and lengths off, which is most at once."""
    offsets = np.random.default_rng(seed).normal(0.0, 3e-3, kuka.joints)
    true_robot = with_geometric_errors(with_other_compliances(kuka, seed, 0.5), seed, 0.01)
    campaign = made(kuka, seed, PLANS[plan], true_robot, offsets, sag=3e-3)
    assert not [fault for fault in faults(campaign, campaign.measurements) if fault.decisive]


def test_a_wrong_sign_is_not_called_shuffled_rows(fanuc):
    campaign = made(fanuc, 1, Plan(poses=20))
    measurements = replace(campaign.measurements, joint_angles=campaign.measurements.joint_angles * [1, 1, -1, 1, 1, 1])
    assert [fault.name for fault in faults(campaign, measurements)] == ["wrong_sign"]


def test_every_fault_of_the_design_is_there_and_of_family_data():
    assert {name for module in fault_modules().values() for name in module.NAMES} == {
        "constant_columns",
        "implausible_measurements",
        "mounted_anew",
        "shuffled_rows",
        "swapped_axes",
        "wrong_frame",
        "wrong_sign",
        "wrong_target",
        "wrong_unit",
    }
    assert {module.FAMILY for module in fault_modules().values()} == {"data"}
