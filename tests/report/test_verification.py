"""The page of a verification states measured beside predicted, and is typeset."""

import pytest
from drawn_figures import empty_pictures
from made_verifications import make_verification

from elastocal.report.typesetting import compile_document
from elastocal.report.verification import collect_verification_facts


@pytest.mark.parametrize("decision", ["pass", "undecided", "fail"])
@pytest.mark.parametrize("held", [True, False])
def test_a_robot_passes_if_the_prediction_held_and_the_tolerance_is_kept(
    held, decision
):
    document = make_verification(held=held, decision=decision)
    facts = collect_verification_facts(document)
    assert facts["passed"] == (held and decision == "pass")
    assert facts["headline"].startswith(f"{decision}, as measured")
    assert ("did not hold" in facts["prediction"]) != held
    kinds = [row[:2] for row in facts["decisions"]]
    assert kinds == [["as predicted", "pass"], ["as measured", decision]]


def test_without_a_tolerance_nothing_is_certified():
    facts = collect_verification_facts(make_verification(certified=False))
    assert facts["passed"] and facts["decisions"] == [] and facts["certificate"] == []
    assert "as measured" not in facts["headline"]


def test_what_remains_starts_another_round():
    facts = collect_verification_facts(make_verification(remains=True))
    assert "0.080 mm RMS remains" in facts["remaining"] and "--with" in facts["now"]
    facts = collect_verification_facts(make_verification())
    assert "No repeatable error is detected" in facts["remaining"]


def test_errors_are_stated_with_level_power_and_frame():
    facts = collect_verification_facts(make_verification())
    assert "test at 5 %" in facts["prediction"]
    assert "0.090 mm RMS is detected in 80 % of cases" in facts["prediction"]
    assert "after the same placement" in facts["prediction"]
    assert "best placement" in facts["whose"] and "target 3" in facts["whose"]
    assert "1 corrected target was not measured" in facts["whose"]
    errors = dict(facts["errors"])
    assert errors["corrected, measured"] == "0.110 mm"


def test_too_few_targets_are_named():
    document = make_verification(decision="undecided")
    document["certificate"]["shortfalls"] = ["9 measured targets"]
    assert (
        "9 measured targets" in collect_verification_facts(document)["certificate"][0]
    )


@pytest.mark.parametrize("certified", [True, False])
def test_the_page_is_typeset(tmp_path, certified):
    facts = collect_verification_facts(make_verification(certified=certified))
    pictures = empty_pictures(tmp_path, ["verification"])
    path = tmp_path / "page.pdf"
    compile_document(path, "verification.typ", {"facts": facts}, pictures)
    assert path.read_bytes().startswith(b"%PDF")
