"""The first page says the verdict in plain words, with probabilities and advice that follow from it."""

import pytest
from made_loop_facts import CAMPAIGNS, plainly
from made_loop_tables import effect_entry, experiment_rows, probabilities, verdict_document

from elastocal.diagnosis.verdict import ADEQUATE, CLASS, NAMED, NOT_TESTABLE, SEVERAL, UNEXPLAINED
from elastocal.report.first_page import TITLES, probability_sentence, sentences, what_to_do

WORDS = {
    "adequate": "none of 30 candidate causes is needed",
    "named": "lacks one mechanism: lost motion (backlash) of joint 3.",
    "named, location uncertain": "Its location is less certain: joint 3 (80 %) and joint 5 (20 %).",
    "class": "most probably lost motion (backlash) of joint 3. Instead of lost motion (backlash) it may be bearing tilt or "
    "elastic bending and torsion: these measurements do not distinguish them.",
    "class with a related mechanism": "Instead of lost motion (backlash) it may be a related mechanism",
    "several": "lacks 2 mechanisms, each with its probability: lost motion (backlash) of joint 3 (94 %) and weight of an "
    "undeclared payload (94 %)",
    "unexplained": "a smooth error of unknown cause explains it better than any of 30 candidate causes",
    "not_testable": "show neither that something is missing nor that nothing is",
    "fault of the data": "The loads fit as if they were written in kilonewtons.",
}


def test_each_verdict_has_its_words():
    assert set(TITLES) == {ADEQUATE, NAMED, CLASS, SEVERAL, UNEXPLAINED, NOT_TESTABLE}


@pytest.mark.parametrize("campaign", WORDS)
def test_the_verdict_is_said_in_plain_words(campaign):
    assert WORDS[campaign] in plainly(" ".join(sentences(CAMPAIGNS[campaign])))


def test_probabilities_are_said_by_hypothesis_with_the_rest():
    sets = [({"link_weight": ["joint 2"]}, 0.94), ({"transmission_harmonic": ["joint 2 orders 1-2"]}, 0.05), ({}, 0.0001)]
    assert plainly(probability_sentence(probabilities(sets))) == (
        "94 % gravity sag of joint 2, 5 % gear transmission error of joint 2 (orders 1-2), 1 % something else"
    )
    sets = [({"link_weight": ["joint 2"], "other": ["base"]}, 0.7), ({"other": ["joint 2"]}, 0.3)]
    assert plainly(probability_sentence(probabilities(sets))) == (
        "70 % gravity sag of joint 2 or a related mechanism, 30 % something that the catalogue does not have"
    )


def test_what_to_do_follows_from_the_verdict_and_from_the_gain():
    gained, lost, unsure = (
        what_to_do(verdict_document(NAMED, [effect_entry()], reduction=ends), [])[0]
        for ends in ((0.15, 0.32), (-0.3, -0.1), (-0.1, 0.3))
    )
    assert gained.startswith("Use the corrected model") and lost.startswith("Do not use") and "not certain" in unsure
    assert "the 10 poses of the section on the next experiment" in what_to_do(CAMPAIGNS["class"], experiment_rows())[1]
    assert "trust the correction at poses and loads like these only" in what_to_do(CAMPAIGNS["class"], [])[1]
    assert any("extrapolated" in advice for advice in what_to_do(CAMPAIGNS["poses outside the range"], []))
    assert not any("extrapolated" in advice for advice in what_to_do(CAMPAIGNS["named"], []))
    assert "Use the declared model" in what_to_do(CAMPAIGNS["adequate"], [])[0]
    assert "loose target" in what_to_do(CAMPAIGNS["unexplained"], [])[0]
