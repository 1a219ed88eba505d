"""The terminal names each report and states the verdict on a campaign."""

from made_loop_tables import CAMPAIGNS

from elastocal.report.outcome import describe_outcome
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
        "! cell7: Whatever a mechanism of the catalogue would contribute"
    )
    assert errors.startswith("  0.171 → ") and errors.endswith(
        " mm (noise 0.050), RMS position error on 10 validation poses"
    )
    advice = 'next: "What to do now" on the first page of the report'
    assert following_lines == [
        "  report: reports/loop/cell7/report.pdf",
        "the study: reports/study.pdf",
        advice,
    ]
    assert lines["named"][0].startswith(
        "✓ cell7: The declared model lacks one mechanism"
    )
    assert lines["named"][-1] == (
        "next: elastocal correct 'my cells/cell7' path.csv --output targets.csv"
    )
