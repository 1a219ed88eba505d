"""Scores of the locations that a verdict states beside its names."""

import io

import pandas as pd
import pytest
from made_blind_documents import (
    PLAN,
    make_adequate_verdict,
    make_effect,
    make_oracle,
    make_plain_verdict,
    make_truth,
    make_verdict,
    tabulate_cases,
)

from elastocal_proof.blind.locations import (
    list_locations,
    tabulate_confusion,
    tabulate_locations,
)
from elastocal_proof.blind.summary import summarize_figures

OFFSET = make_truth(("joint_offset", 3), level=200.0)
OFFSETS = make_truth(
    ("joint_offset", 2), ("joint_offset", 4), group="several_joints", level=200.0
)
PAIR = make_truth(("payload",), ("joint_tilt", 2), group="pair")
ABSORBED = make_truth(("joint_offset", 1))
ABSORBED["defects"][0]["of"] = "raw"


def name_offset(*joints):
    return make_verdict("named", make_effect("joint_offset", *joints))


@pytest.mark.parametrize(
    ("truth", "verdict", "expected"),
    [
        (OFFSET, name_offset(3), ["right"]),
        (OFFSET, name_offset(4), ["wrong"]),
        (OFFSET, name_offset(3, 4), ["partly"]),
        (OFFSET, make_plain_verdict("named", "payload"), ["not stated"]),
        # The right joint of a wrong name does not count.
        (
            OFFSET,
            make_verdict("named", make_effect("joint_tilt", 3)),
            ["not stated"],
        ),
        (OFFSET, make_adequate_verdict(), ["not stated"]),
        (OFFSETS, name_offset(2, 4), ["right"]),
        (OFFSETS, name_offset(2), ["partly"]),
        # An effect without a joint has no location.
        (PAIR, make_plain_verdict("named", "payload"), ["not stated"]),
        (make_truth(("payload",)), make_plain_verdict("named", "payload"), []),
        (make_truth(("outside:slipping_zero", 3)), name_offset(3), []),
        (ABSORBED, name_offset(1), []),
        (make_truth(), name_offset(1), []),
    ],
)
def test_the_joints_of_a_named_effect_are_right_partly_right_wrong_or_not_stated(
    truth, verdict, expected
):
    assert [row["outcome"] for row in list_locations(truth, verdict)] == expected


def test_a_confusion_table_counts_stated_joints_by_true_joint():
    entries = [(OFFSET, name_offset(3))] * 2
    entries += [(OFFSET, name_offset(4)), (OFFSET, name_offset(3, 4))]
    entries += [(OFFSET, make_adequate_verdict()), (OFFSETS, name_offset(2))]
    rows = [row for entry in entries for row in list_locations(*entry)]
    made = tabulate_locations(rows)
    read = pd.read_csv(io.StringIO(made.to_csv(index=False)))
    for table in (made, read):
        [row] = tabulate_confusion(table).to_dict("records")
        assert row == {"true": 3, "3": 2, "4": 1, "several": 1, "not stated": 1}


def test_no_location_gives_an_empty_confusion_table():
    assert tabulate_confusion(tabulate_locations([])).empty


@pytest.mark.parametrize(("right", "holds"), [(18, True), (17, False)])
def test_the_share_of_right_joints_has_an_interval_and_a_target(right, holds):
    """Only effects that are named count among the stated joints."""
    verdicts = [name_offset(3)] * right + [name_offset(4)] * (20 - right)
    verdicts += [make_adequate_verdict()] * 5
    entries = [(OFFSET, verdict, make_oracle()) for verdict in verdicts]
    rows = [
        row for truth, verdict, _ in entries for row in list_locations(truth, verdict)
    ]
    summary = summarize_figures(
        PLAN,
        tabulate_cases(*entries),
        pd.DataFrame(),
        1,
        tabulate_locations(rows),
    ).set_index("quantity")
    figure = summary.loc["joints of an effect that is stated: the true ones at 200"]
    assert (figure.hits, figure.cases, figure.holds) == (right, 20, holds)
    assert figure.low < figure.rate < figure.high
    wrong = summary.loc["joints of an effect that is stated: all wrong at 200"]
    assert (wrong.hits, wrong.cases) == (20 - right, 20)
    stated = summary.loc["effects at joints: stated with joints at 200"]
    assert (stated.hits, stated.cases) == (20, 25)
