"""A verdict is counted for what it is worth."""

import pytest
from made_verdicts import said, truth

from elastocal.blind.scores import outcome

OUTCOMES = {
    "right name": (truth("payload"), said("named", "payload"), {"detected", "exact", "named_right", "holds_truth"}),
    "wrong name": (truth("payload"), said("named", "link_weight"), {"detected", "wrong_name"}),
    "class that holds it": (
        truth("payload"),
        said("class", "link_weight", alternatives=["payload"]),
        {"detected", "holds_truth"},
    ),
    "variant among the alternatives": (
        truth("force_bias"),
        said("class", "payload", alternatives=["force_bias[base axes]"]),
        {"detected", "holds_truth"},
    ),
    "missed": (truth("payload"), said("adequate"), set()),
    "silence where nothing is": (truth(group="none"), said("adequate"), set()),
    "false alarm": (truth(group="none"), said("named", "payload"), {"detected", "wrong_name"}),
    "one of two": (truth("payload", "joint_tilt", group="pair"), said("named", "payload"), {"detected", "wrong_name"}),
    "both of two": (
        truth("payload", "joint_tilt", group="pair"),
        said("several", "joint_tilt", "payload"),
        {"detected", "exact", "holds_truth"},
    ),
    "one effect and another that is not there": (truth("payload"), said("several", "payload", "link_weight"), {"detected"}),
    "right name that does not explain enough": (truth("payload"), said("unexplained", "payload"), {"detected"}),
    "two classes that hold both": (
        truth("payload", "joint_tilt", group="pair"),
        said("several", "link_weight", "payload", alternatives=["payload@2", "joint_tilt@1"]),
        {"detected", "holds_truth"},
    ),
    "two classes that hold but one": (
        truth("payload", "joint_tilt", group="pair"),
        said("several", "link_weight", "link_geometry", alternatives=["payload"]),
        {"detected"},
    ),
}


@pytest.mark.parametrize("name", OUTCOMES)
def test_outcome_is(name):
    sealed, verdict, expected = OUTCOMES[name]
    row = outcome(sealed, verdict)
    assert {key for key, value in row.items() if value is True} == expected


def test_the_robot_of_tuning_is_told_from_those_of_the_proof():
    document = truth("payload")
    assert outcome(document, said("adequate"))["robots"] == "proof"
    assert outcome(document | {"case": document["case"] | {"robot": "kuka"}}, said("adequate"))["robots"] == "tuned"
