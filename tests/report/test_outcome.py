"""The terminal says of each report where it is and, of a campaign, the verdict."""

import json

from elastocal.report.outcome import outcome


def test_the_outcome_names_reports_and_verdicts(tmp_path, monkeypatch):
    folder = tmp_path / "reports/loop/cell7"
    folder.mkdir(parents=True)
    heldout = {"uncalibrated": {"rms_m": 4e-3}, "after": {"rms_m": 1e-3}, "noise_floor_rms_m": 9e-4, "poses": 9}
    verdict = {"verdict": "not_testable", "effects": [], "heldout": heldout, "warnings": []}
    (folder / "verdict.json").write_text(json.dumps(verdict), encoding="utf-8")
    monkeypatch.setattr("elastocal.report.first_page.sentences", lambda document: [document["verdict"], "more"])
    made = ["reports/study.pdf", "reports/loop/cell7/report.pdf", "reports/tables/table1.csv"]
    first, errors, *rest = outcome(made, tmp_path)
    assert first == "! cell7: not_testable"
    assert errors == "  4.00 → 1.00 mm (noise 0.900), RMS position error on 9 validation poses"
    following = 'next: "What to do now" on the first page of the report'
    assert rest == ["  report: reports/loop/cell7/report.pdf", "the study: reports/study.pdf", following]
    (folder / "verdict.json").write_text(json.dumps(verdict | {"verdict": "named"}), encoding="utf-8")
    first, *_, last = outcome(made, tmp_path)
    assert first == "✓ cell7: named" and last == "next: elastocal correct, elastocal certificate"
