"""What every fault is and its modules say of themselves; what is only wrong with the model is none."""

from dataclasses import replace

import numpy as np
import pytest
from made_campaigns import Plan, made, with_geometric_errors, with_other_compliances

from elastocal.data_checks.protocol import Fault, Value, data_at_fault, fault_modules, faults
from elastocal.diagnosis.verdict import fault_entry

FAULT = Fault("wrong_sign", (2,), "joint 2 fits counted the other way round", (Value("x", 0.5, "m"),), (0.3, 1e-4), (), True)


def test_faults_of_the_same_contents_are_equal_and_one_of_a_set():
    """Only what cannot be changed afterwards can be in a set."""
    assert FAULT.alternatives == ()
    same = replace(FAULT, parameters=(Value("x", 0.5, "m"),))
    assert same == FAULT and len({same, FAULT, replace(FAULT, joints=(3,))}) == 2
    assert replace(FAULT, parameters=(Value("x", 0.5, "mm"),)) != FAULT


@pytest.mark.parametrize("name", fault_modules())
def test_every_module_names_its_faults_its_family_and_the_modules_before_it(name):
    module = fault_modules()[name]
    assert module.NAMES and all(isinstance(each, str) and each.isidentifier() for each in module.NAMES)
    assert len(set(module.NAMES)) == len(module.NAMES)
    assert isinstance(module.FAMILY, str) and callable(module.find)
    assert isinstance(module.AFTER, tuple) and set(module.AFTER) <= set(fault_modules()) - {name}


def test_a_verdict_with_a_fault_beside_effects_finds_the_data_at_fault_and_one_without_does_not():
    effect = {"family": "gravity"}
    assert data_at_fault({"effects": [effect, fault_entry(FAULT)]})
    assert not data_at_fault({"effects": [effect]}) and not data_at_fault({"effects": []})


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
