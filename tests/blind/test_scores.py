"""A verdict is counted for what it is worth: its words, its errors, its probabilities
and its intervals."""

import numpy as np
import pytest
from made_blind_documents import (
    PLAN,
    effect,
    frame,
    oracle,
    said,
    silence,
    truth,
    verdict,
)

from elastocal_proof.blind.scores import (
    build_case_row,
    is_true,
    list_intervals,
    score_probabilities,
)

TILTED = {"misplaced": {"shift_m": [0.0, 0.0, 2e-4], "turn_rad": [3e-4, 0.0, 0.0]}}
PAYLOAD = truth(("payload",))
NOTHING = truth()
PAIR = truth(("payload",), ("joint_tilt", 2), group="pair")
COUNTED = ("detected", "exact", "named_right", "holds_truth", "wrong_name", "remains")
RIGHT = {"detected", "exact", "named_right", "holds_truth"}
OUTCOMES = {
    "a base that is misplaced": (
        truth(group="setting") | TILTED,
        said("named", "base_placement"),
        set(),
    ),
    "a base that is not": (
        NOTHING,
        said("named", "base_placement"),
        {"detected", "wrong_name"},
    ),
    "another name beside it": (
        NOTHING | TILTED,
        said("several", "base_placement", "payload"),
        {"detected", "wrong_name"},
    ),
    "right name beside it": (
        PAYLOAD | TILTED,
        said("several", "base_placement", "payload"),
        RIGHT,
    ),
    "right name": (PAYLOAD, said("named", "payload"), RIGHT),
    "wrong name": (PAYLOAD, said("named", "link_weight"), {"detected", "wrong_name"}),
    "class that holds it": (
        PAYLOAD,
        said("class", "link_weight", alternatives=["payload"]),
        {"detected", "holds_truth"},
    ),
    "variant": (
        truth(("force_bias",)),
        said("class", "payload", alternatives=["force_bias[base axes]"]),
        {"detected", "holds_truth"},
    ),
    "missed": (PAYLOAD, said("adequate"), set()),
    "silence where nothing is": (NOTHING, said("adequate"), set()),
    "false alarm": (NOTHING, said("named", "payload"), {"detected", "wrong_name"}),
    "one of two": (PAIR, said("named", "payload"), {"detected", "wrong_name"}),
    "both of two": (
        PAIR,
        said("several", "joint_tilt", "payload"),
        {"detected", "exact", "holds_truth"},
    ),
    "one that is not there": (
        PAYLOAD,
        said("several", "payload", "link_weight"),
        {"detected"},
    ),
    "not enough": (PAYLOAD, said("unexplained", "payload"), {"detected"}),
    "two classes that hold both": (
        PAIR,
        said(
            "several",
            "link_weight",
            "payload",
            alternatives=["payload@2", "joint_tilt@1"],
        ),
        {"detected", "holds_truth"},
    ),
    "two that hold one": (
        PAIR,
        said("several", "link_weight", "link_geometry", alternatives=["payload"]),
        {"detected"},
    ),
}


@pytest.mark.parametrize("name", OUTCOMES)
def test_outcome_is(name):
    sealed, found, expected = OUTCOMES[name]
    row = build_case_row(PLAN, sealed, found)
    assert {key for key in COUNTED if row[key] is True} == expected


@pytest.mark.parametrize(
    ("reduction", "adopted", "expected"),
    [
        ((-0.14, -0.06), True, (True, True)),
        ((-0.25, 0.05), True, (False, True)),
        ((-0.14, -0.06), False, (True, False)),
    ],
)
def test_worse_is_beyond_two_standard_errors_and_counts_where_something_was_adopted(
    reduction, adopted, expected
):
    found = verdict(
        "named",
        effect("payload", adopted=adopted),
        before=1e-4,
        after=1.1e-4,
        reduction=reduction,
    )
    row = build_case_row(PLAN, PAYLOAD, found, oracle())
    assert (row["worse"], row["adopted"]) == expected


def test_exact_aliases_are_told_by_the_truth_its_joints_and_the_robot():
    places = [
        ("transmission_harmonic", 2),
        ("transmission_harmonic", 3),
        ("link_weight", 2),
        ("link_weight", 2, 3),
    ]
    assert frame(
        *((truth(place), silence(), oracle()) for place in places)
    ).exact_alias.tolist() == [True, False, True, False]
    # An arm that has no compensator has no alias of it.
    assert not build_case_row(
        PLAN, truth(places[0], robot="gen3"), silence(), oracle()
    )["exact_alias"]


def test_a_fault_of_the_data_that_ended_a_diagnosis_has_no_errors_and_states_nothing():
    row = build_case_row(
        PLAN, PAYLOAD, verdict("named", effect("wrong_unit")) | {"heldout": None}, None
    )
    assert (
        np.isnan(row["after_rms_m"])
        and not row["worse"]
        and np.isnan(row["stated"])
        and np.isnan(row["oracle_rms_m"])
    )


FOREIGN = truth(("outside:refraction",), group="outside")
ABSORBED = truth(("force_scale",))
ABSORBED["defects"][0]["of"] = "raw"


@pytest.mark.parametrize(
    ("document", "mechanisms", "so"),
    [
        (PAYLOAD, ("payload",), True),
        (PAYLOAD, ("payload", "joint_tilt"), False),
        # A related mechanism is not that one.
        (PAYLOAD, ("payload", "other"), False),
        (PAYLOAD, (), False),
        (NOTHING, (), True),
        (NOTHING, ("other",), False),
        (FOREIGN, ("payload", "other"), True),
        (FOREIGN, ("payload",), False),
        (PAIR, ("joint_tilt", "payload"), True),
        (NOTHING | TILTED, ("base_placement",), True),
        (
            truth(("joint_offset", 2), ("joint_offset", 4), group="several_joints"),
            ("joint_offset",),
            True,
        ),
        (ABSORBED, (), True),
        (ABSORBED, ("force_scale",), False),
    ],
)
def test_true_is_the_exact_set_of_mechanisms_and_outside_of_the_catalogue_every_set_with_other(
    document, mechanisms, so
):
    assert is_true(mechanisms, document) == so


@pytest.mark.parametrize(
    ("shares", "place", "held"),
    [
        ((0.6, 0.3, 0.06, 0.04), 2, True),
        ((0.6, 0.3, 0.06, 0.04), 3, False),
        ((0.6, 0.3), 1, True),
        ((0.97, 0.03), 1, False),
    ],
)
def test_the_credible_set_is_the_smallest_that_reaches_95_per_cent(shares, place, held):
    names = ["a", "b", "c", "d"]
    names[place] = "payload"
    sets = [
        {"mechanisms": [name], "probability": share}
        for name, share in zip(names, shares, strict=False)
    ]
    found = score_probabilities(PAYLOAD, {"probabilities": {"sets": sets[::-1]}})
    assert (found["held"], found["stated"], found["correct"]) == (
        held,
        max(shares),
        False,
    )


def of_effect(document, found):
    return [
        row
        for row in list_intervals(document, found)
        if row["effect"] != "joint_compliance"
    ]


def with_parameters(document, *values):
    for defect, value in zip(document["defects"], values, strict=True):
        defect["parameters"] = {"offset": value}
    return document


def test_an_interval_holds_what_lies_within_two_standard_errors_of_the_right_effect_at_the_right_joint():
    offset = with_parameters(truth(("joint_offset", 3)), 3e-4)
    for value, holds in (
        (3.19e-4, True),
        (3.21e-4, False),
        (2.81e-4, True),
        (2.79e-4, False),
    ):
        (row,) = of_effect(
            offset,
            verdict(
                "named", effect("joint_offset", 3, parameters=[("offset", value, 1e-5)])
            ),
        )
        assert row["holds"] == holds
    there = [("offset", 3e-4, 1e-5)]
    assert not of_effect(offset, verdict("named", effect("link_geometry", 3)))
    assert not of_effect(
        offset, verdict("named", effect("joint_offset", 4, parameters=there))
    )
    assert not of_effect(
        offset,
        verdict("named", effect("joint_offset", 3, parameters=[("offset", 0.0, 0.0)])),
    )
    # Student's t is wider where the noise has few degrees of freedom.
    few = verdict(
        "named",
        effect("joint_offset", 3, parameters=[("offset", 3.3e-4, 1e-5)]),
        freedom=3,
    )
    assert of_effect(offset, few)[0]["holds"]
