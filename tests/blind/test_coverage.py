"""Intervals are held against the truth that they can be compared with."""

import pandas as pd
from made_blind_documents import effect, silence, truth, verdict

from elastocal_proof.blind.coverage import covered, intervals_of


def with_parameters(document, **parameters):
    document["defects"][0]["parameters"] = parameters
    return document


OFFSET = with_parameters(truth(("joint_offset", 3)), offset=3e-4)


def of_effect(document, said):
    return [row for row in intervals_of(document, said) if row["effect"] != "joint_compliance"]


def test_an_interval_holds_what_lies_within_two_standard_errors():
    for value, holds in ((3.19e-4, True), (3.21e-4, False), (2.81e-4, True), (2.79e-4, False)):
        (row,) = of_effect(OFFSET, verdict("named", effect("joint_offset", 3, parameters=[("offset", value, 1e-5)])))
        assert row["holds"] == holds


def test_few_degrees_of_freedom_make_it_wider():
    said = verdict("named", effect("joint_offset", 3, parameters=[("offset", 3.21e-4, 1e-5)]), freedom=5)
    assert of_effect(OFFSET, said)[0]["holds"]


def test_only_the_right_effect_at_the_right_joint_is_compared():
    there = [("offset", 3e-4, 1e-5)]
    assert not of_effect(OFFSET, verdict("named", effect("link_geometry", 3)))
    assert not of_effect(OFFSET, verdict("named", effect("joint_offset", 4, parameters=there)))
    assert not of_effect(OFFSET, verdict("named", effect("joint_offset", 3, parameters=[("offset", 0.0, 0.0)])))


def test_a_right_effect_counts_whatever_was_found_beside_it():
    there = [("offset", 3e-4, 1e-5)]
    assert len(of_effect(OFFSET, verdict("several", effect("joint_offset", 3, parameters=there), effect("payload")))) == 1


def test_of_one_mechanism_at_several_joints_each_joint_is_compared_with_its_own():
    document = truth(("joint_offset", 2), ("joint_offset", 3), group="several_joints")
    for number, defect in enumerate(document["defects"]):
        defect["parameters"] = {"offset": 1e-4 * (number + 1)}
    found = effect("joint_offset", 2, 3)
    found["parameters"] = [
        {"name": f"joint_offset@{joint} offset", "value": value, "std_error": 1e-6, "held": False}
        for joint, value in ((2, 1e-4), (3, 2e-4))
    ]
    rows = of_effect(document, verdict("named", found))
    assert [(row["true"], row["holds"]) for row in rows] == [(1e-4, True), (2e-4, True)]


def test_compliances_count_whatever_was_found():
    assert len(intervals_of(truth(), silence())) == 6
    assert len(intervals_of(truth(), verdict("named", effect("payload"), compliance=1.3))) == 6
    assert not any(row["holds"] for row in intervals_of(truth(), silence(compliance=1.3)))
    assert len(intervals_of(truth(("payload",)), verdict("named", effect("payload")))) == 6
    assert len(intervals_of(truth(("payload",)), silence())) == 6


def test_all_are_counted_and_those_by_another_law_are_marked():
    motion = with_parameters(truth(("lost_motion", 1)), half_play=1e-4)
    entries = [
        (OFFSET, verdict("named", effect("joint_offset", 3, parameters=[("offset", 3e-4, 1e-5)]))),
        (motion, verdict("named", effect("lost_motion", 1, parameters=[("half_play", 9e-4, 1e-5)]))),
    ]
    table = covered(pd.DataFrame([row for entry in entries for row in intervals_of(*entry)])).set_index(
        ["kind", "effect", "comparable", "parameter", "level"]
    )
    assert table.loc[("effect", "all", "all", "all", "all"), ["hits", "cases"]].tolist() == [1, 2]
    assert table.loc[("effect", "lost_motion", "by another law", "half_play", "all"), "hits"] == 0
    assert table.loc[("effect", "joint_offset", "exact", "offset", "all"), "hits"] == 1
    assert table.loc[("effect", "joint_offset", "exact", "all", "50"), "cases"] == 1
    assert table.loc[("compliance, effect found", "joint_compliance", "exact", "all", "all"), "cases"] == 12


def test_without_any_interval_the_table_is_empty():
    assert len(covered(pd.DataFrame())) == 0
