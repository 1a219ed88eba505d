"""The terminal names each report and states the verdict on a campaign."""

from dataclasses import replace

from made_loop_tables import CAMPAIGNS

from elastocal.report.outcome import describe_outcome, describe_verdict
from elastocal.verdict import write_verdict


def test_the_outcome_names_reports_and_verdicts(tmp_path):
    folder = tmp_path / "reports/loop/cell7"
    folder.mkdir(parents=True)
    files = [
        "reports/study.pdf",
        "reports/loop/cell7/report.pdf",
        "reports/tables/table1.csv",
    ]
    lines = {}
    for name in ("not_testable", "named"):
        write_verdict(folder / "verdict.json", CAMPAIGNS[name])
        lines[name] = describe_outcome(files, tmp_path, "my cells/cell7")
    verdict_line, errors, *following_lines = lines["not_testable"]
    assert verdict_line.startswith(
        "! cell7: At a plausible size, each mechanism of the catalogue"
    )
    assert errors.startswith("  0.171 → ") and errors.endswith(
        " mm (noise 0.050), RMS position error on 10 validation poses"
    )
    advice = 'next: "What to do now" on the first page of the report'
    assert following_lines == [
        f"  report: {tmp_path}/reports/loop/cell7/report.pdf",
        "the study: reports/study.pdf",
        advice,
    ]
    assert lines["named"][0].startswith(
        "✓ cell7: The declared model lacks one mechanism"
    )
    assert lines["named"][-1] == (
        "next: elastocal correct 'my cells/cell7' path.csv --output targets.csv"
    )


def test_the_error_of_a_campaign_of_contacts_is_no_position_error():
    verdict = CAMPAIGNS["named"]
    contacts = replace(verdict.heldout, error="distance from the plane")
    headline = describe_verdict("cell7", replace(verdict, heldout=contacts))[1]
    assert headline.endswith(", RMS distance from the plane on 10 validation poses")


def test_each_warning_of_a_diagnosis_is_a_line():
    """A fit that did not converge, rows that were left out, and effects that made the
    errors of validation poses larger."""
    warnings = (
        "the fit of the final model did not converge",
        "row 7 lies 3.1 mm off the model and was left out",
        "the RMS error of the validation poses grew from 0.100 to 0.120 mm",
    )
    verdict = replace(CAMPAIGNS["named"], warnings=warnings)
    *_, first, second, third = describe_verdict("cell7", verdict)
    assert first == "! The fit of the final model did not converge."
    assert second == "! Row 7 lies 3.1 mm off the model and was left out."
    assert third.endswith("grew from 0.100 to 0.120 mm.")
    assert not any(
        line.startswith("! ") for line in describe_verdict("cell7", CAMPAIGNS["named"])
    )
