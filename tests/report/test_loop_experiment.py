"""The next experiment is told so that somebody can carry it out, or why there is none."""

from made_loop_facts import CAMPAIGNS, facts_of
from made_loop_tables import effect_entry, experiment_rows, verdict_document

from elastocal.diagnosis.verdict import CLASS, NAMED


def test_the_next_experiment_is_in_degrees_and_says_what_it_separates():
    facts = facts_of(CAMPAIGNS["class"], experiment=experiment_rows(count=3))["experiment"]
    loads = ["fx N", "fy N", "fz N", "mx N·m", "my N·m", "mz N·m"]
    assert facts["heads"] == ["point", *(f"q{k} °" for k in range(1, 7)), *loads, "separation"]
    angles, wrench = ["−5.7", "−11.5", "−17.2", "−22.9", "−28.6", "−34.4"], ["910", "0", "−412", "−206", "0", "455"]
    assert facts["rows"][2] == ["6DoF", *angles, *wrench, "12.0"]
    unloaded = [row | dict.fromkeys(("fx", "fy", "fz", "mx", "my", "mz"), 0.0) for row in experiment_rows()]
    assert facts_of(CAMPAIGNS["class"], experiment=unloaded)["experiment"]["heads"][-2:] == ["q6 °", "separation"]


def test_the_side_of_the_approach_and_reference_weights_are_asked_for():
    sides = {f"approach{joint}": side for joint, side in enumerate((1.0, -1.0, 0.0, 1.0, 1.0, -1.0), 1)}
    rows = [row | sides | {"reference_weight_kg": 25.0} for row in experiment_rows(count=2)]
    told = facts_of(CAMPAIGNS["class"], experiment=rows)["experiment"]
    assert told["heads"][-3:] == ["approach", "weight kg", "separation"] and told["approach"]
    assert told["rows"][0][-3:] == ["+−0++−", "25.0", "10.0"]


def test_where_nothing_is_proposed_the_reason_is_said():
    said = facts_of(verdict_document(NAMED, [effect_entry()], next_experiment={"reason": "nothing is ambiguous"}))["experiment"]
    assert said["sentence"] == "No further measurement is proposed: nothing is ambiguous." and said["rows"] == []
    told = {"sentence": "10 poses separate joint_tilt from link_weight.", "reason": ""}
    facts = facts_of(verdict_document(CLASS, [effect_entry(alternatives=["other"])], next_experiment=told))
    assert facts["experiment"]["sentence"] == "10 poses separate bearing tilt from gravity sag."
    assert facts_of(CAMPAIGNS["named"])["experiment"]["sentence"] == ""
