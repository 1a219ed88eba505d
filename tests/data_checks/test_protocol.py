"""What every fault is, and what its modules must say of themselves."""

from dataclasses import replace

import pytest

from elastocal.data_checks.catalogue import fault_modules
from elastocal.data_checks.protocol import Fault, Value, data_at_fault
from elastocal.diagnosis.findings import fault_entry

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
