"""What a fault makes of a verdict."""

from elastocal.data_checks.protocol import Fault, Value, data_at_fault
from elastocal.diagnosis.verdict import fault_entry

FAULT = Fault(
    "wrong_sign",
    (2,),
    "joint 2 fits counted the other way round",
    (Value("x", 0.5, "m"),),
    (0.3, 1e-4),
)


def test_a_verdict_with_a_fault_beside_effects_finds_the_data_at_fault_and_one_without_does_not():
    effect = {"family": "gravity"}
    assert data_at_fault({"effects": [effect, fault_entry(FAULT)]})
    assert not data_at_fault({"effects": [effect]}) and not data_at_fault(
        {"effects": []}
    )
