"""A fault of the data makes a verdict that says nothing of the robot."""

from dataclasses import replace

from made_loop_tables import CAMPAIGNS

from elastocal.data_checks.protocol import DATA_FAMILY, Fault, Value
from elastocal.diagnosis.effect_estimates import state_fault

FAULT = Fault(
    "wrong_sign",
    (2,),
    "joint 2 fits counted the other way round",
    (Value("x", 0.5, "m"),),
    (0.3, 1e-4),
)


def test_a_verdict_with_a_fault_finds_the_data_at_fault_and_one_without_does_not():
    verdict = CAMPAIGNS["named"]
    fault = state_fault(FAULT)
    assert fault.family == DATA_FAMILY
    faulty = replace(verdict, effects=(*verdict.effects, fault))
    assert faulty.faults == (fault,)
    assert not verdict.faults and not replace(verdict, effects=()).faults
