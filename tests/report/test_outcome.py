"""The terminal says of each report where it is and, of a campaign, the verdict."""

from made_loop_tables import CAMPAIGNS

from elastocal.report.outcome import describe_outcome
from elastocal.verdict import write_verdict


def test_the_outcome_names_reports_and_verdicts(tmp_path):
    folder = tmp_path / "reports/loop/cell7"
    folder.mkdir(parents=True)
    made = [
        "reports/study.pdf",
        "reports/loop/cell7/report.pdf",
        "reports/tables/table1.csv",
    ]
    said = {}
    for name in ("not_testable", "named"):
        write_verdict(folder / "verdict.json", CAMPAIGNS[name])
        said[name] = describe_outcome(made, tmp_path)
    first, errors, *rest = said["not_testable"]
    assert first.startswith(
        "! cell7: Whatever a mechanism of the catalogue would contribute"
    )
    assert errors.startswith("  0.171 → ") and errors.endswith(
        " mm (noise 0.050), RMS position error on 10 validation poses"
    )
    following = 'next: "What to do now" on the first page of the report'
    assert rest == [
        "  report: reports/loop/cell7/report.pdf",
        "the study: reports/study.pdf",
        following,
    ]
    assert said["named"][0].startswith(
        "✓ cell7: The declared model lacks one mechanism"
    )
    assert said["named"][-1] == "next: elastocal correct, elastocal certificate"
