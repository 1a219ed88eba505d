"""While it works Snakemake says one line a job; at the end, reports and verdicts, or last of all why a job failed."""

import json

from outcome import outcome


def test_a_job_is_one_line_without_lists_of_files(finished):
    finished.path("results/identified/kuka/200um/6DoF.parquet").unlink()
    said = finished.run("results/identified/kuka/200um/6DoF.parquet").stderr.splitlines()
    assert "1 jobs" in said
    assert [line for line in said if line.startswith("1 of 1: identify")] == ["1 of 1: identify kuka 200 6DoF"]
    assert max(map(len, said)) < 200


def test_the_outcome_names_reports_and_verdicts(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    folder = tmp_path / "reports/loop/cell7"
    folder.mkdir(parents=True)
    verdict = {"verdict": "not_testable", "effects": [], "not_identifiable": [], "warnings": []}
    (folder / "verdict.json").write_text(json.dumps(verdict), encoding="utf-8")
    monkeypatch.setattr("elastocal.report.first_page.sentences", lambda document: [document["verdict"], "more"])
    made = ["reports/study.pdf", "reports/loop/cell7/report.pdf", "reports/tables/table1.csv"]
    assert outcome(made) == ["cell7: not_testable", "    reports/loop/cell7/report.pdf", "the study: reports/study.pdf"]


def test_a_script_that_fails_while_it_imports_has_no_log_and_is_said_to_have_none(finished):
    finished.path("results/identified/kuka/200um/6DoF.parquet").unlink()
    script = finished.path("workflow/scripts/identify.py")
    script.write_text("import none_of_this_name\n" + script.read_text(encoding="utf-8"), encoding="utf-8")
    ended = finished.snakemake("-j1", "results/identified/kuka/200um/6DoF.parquet")
    said = ended.stderr.splitlines()
    assert ended.returncode != 0 and any(
        "No module named 'none_of_this_name'" in line for line in said + ended.stdout.splitlines()
    )
    assert said[-1].startswith(
        "identify: found an end before its log began (results/logs/identify/kuka/200um/6DoF.log); allowed: "
    )
