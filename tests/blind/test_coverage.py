"""Intervals are held against the truth that they can be compared with."""

from made_blind_documents import effect, silence, truth, verdict

from elastocal_proof.blind.coverage import intervals_of


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


def test_only_the_right_effect_at_the_right_joint_is_compared():
    there = [("offset", 3e-4, 1e-5)]
    assert not of_effect(OFFSET, verdict("named", effect("link_geometry", 3)))
    assert not of_effect(OFFSET, verdict("named", effect("joint_offset", 4, parameters=there)))
    assert not of_effect(OFFSET, verdict("named", effect("joint_offset", 3, parameters=[("offset", 0.0, 0.0)])))


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
