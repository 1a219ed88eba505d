"""A verdict is counted for what it is worth."""

import pytest
from made_verdicts import truth, verdict_of

from elastocal_proof.blind.scores import outcome

TILTED = {"misplaced": {"shift_m": [0.0, 0.0, 2e-4], "turn_rad": [3e-4, 0.0, 0.0]}}
OUTCOMES = {
    "a base that is misplaced": (truth(group="setting") | TILTED, verdict_of("named", "base_placement"), set()),
    "a base that is not": (truth(group="setting"), verdict_of("named", "base_placement"), {"detected", "wrong_name"}),
    "another name beside a misplaced base": (
        truth(group="setting") | TILTED,
        verdict_of("several", "base_placement", "payload"),
        {"detected", "wrong_name"},
    ),
    "right name beside a misplaced base": (
        truth("payload", group="setting") | TILTED,
        verdict_of("several", "base_placement", "payload"),
        {"detected", "exact", "named_right", "holds_truth"},
    ),
    "right name": (truth("payload"), verdict_of("named", "payload"), {"detected", "exact", "named_right", "holds_truth"}),
    "wrong name": (truth("payload"), verdict_of("named", "link_weight"), {"detected", "wrong_name"}),
    "class that holds it": (
        truth("payload"),
        verdict_of("class", "link_weight", alternatives=["payload"]),
        {"detected", "holds_truth"},
    ),
    "variant among the alternatives": (
        truth("force_bias"),
        verdict_of("class", "payload", alternatives=["force_bias[base axes]"]),
        {"detected", "holds_truth"},
    ),
    "missed": (truth("payload"), verdict_of("adequate"), set()),
    "silence where nothing is": (truth(group="none"), verdict_of("adequate"), set()),
    "false alarm": (truth(group="none"), verdict_of("named", "payload"), {"detected", "wrong_name"}),
    "one of two": (truth("payload", "joint_tilt", group="pair"), verdict_of("named", "payload"), {"detected", "wrong_name"}),
    "both of two": (
        truth("payload", "joint_tilt", group="pair"),
        verdict_of("several", "joint_tilt", "payload"),
        {"detected", "exact", "holds_truth"},
    ),
    "one effect and another that is not there": (
        truth("payload"),
        verdict_of("several", "payload", "link_weight"),
        {"detected"},
    ),
    "right name that does not explain enough": (truth("payload"), verdict_of("unexplained", "payload"), {"detected"}),
    "two classes that hold both": (
        truth("payload", "joint_tilt", group="pair"),
        verdict_of("several", "link_weight", "payload", alternatives=["payload@2", "joint_tilt@1"]),
        {"detected", "holds_truth"},
    ),
    "two classes that hold but one": (
        truth("payload", "joint_tilt", group="pair"),
        verdict_of("several", "link_weight", "link_geometry", alternatives=["payload"]),
        {"detected"},
    ),
}


@pytest.mark.parametrize("name", OUTCOMES)
def test_outcome_is(name):
    sealed, verdict, expected = OUTCOMES[name]
    row = outcome(sealed, verdict)
    assert {key for key, value in row.items() if value is True} == expected
