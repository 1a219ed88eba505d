"""While it works Snakemake says one line a job; at the end, reports and verdicts, or
last of all why a job failed."""

import re
from collections import Counter

from study_folder import PAPER

IDENTIFIED = "results/identified/kuka/200um/6DoF.parquet"
LOG = "results/logs/identify/kuka/200/6DoF.log"


def test_a_job_is_one_line_without_lists_of_files(finished_paper):
    finished_paper.path(IDENTIFIED).unlink()
    lines = finished_paper.run(IDENTIFIED).stderr.splitlines()
    assert "1 job" in lines
    assert [line for line in lines if line.startswith("1 of 1: identify")] == [
        "1 of 1: identify kuka 200 6DoF"
    ]
    assert max(map(len, lines)) < 200


def test_a_dry_run_is_a_summary_and_every_job_is_listed_on_request(unstarted):
    done = unstarted.snakemake("-n", PAPER)
    assert done.returncode == 0, done.stderr
    counts = dict(re.findall(r"^(\w+) +(\d+)$", done.stdout, re.MULTILINE))
    jobs = Counter(rule for rule, *_ in unstarted.planned(PAPER))
    assert {rule: int(count) for rule, count in counts.items()} == {
        **jobs,
        "total": sum(jobs.values()),
    }
    assert "input:" not in done.stdout


def test_the_log_of_a_script_that_fails_while_it_imports_says_why(finished_paper):
    finished_paper.path(IDENTIFIED).unlink()
    finished_paper.append("src/elastocal/study/evaluation.py", "1 / 0\n")
    ended = finished_paper.snakemake("-j1", IDENTIFIED)
    last = "ZeroDivisionError: division by zero"
    assert ended.returncode != 0 and ended.stderr.splitlines()[-1] == last
    log = finished_paper.path(LOG).read_text(encoding="utf-8").splitlines()
    assert log[0].startswith("Traceback") and log[-1] == last


def test_a_script_that_is_ended_before_it_begins_has_no_log_and_is_said_to_have_none(
    finished_paper,
):
    finished_paper.replace(
        "workflow/scripts/typeset_table.py",
        "from job import Job, origin_of, run\n",
        "import os\n\nos._exit(9)\n",
    )
    # An earlier run was successful: its log says nothing of this one.
    log = finished_paper.path("results/logs/typeset_table/table1.log")
    log.parent.mkdir(parents=True, exist_ok=True)
    log.write_text("done\n", encoding="utf-8")
    ended = finished_paper.snakemake("-j1", "reports/tables/table1.md")
    message = (
        "typeset_table: found that the job was killed before it wrote its log "
        "(results/logs/typeset_table/table1.log); allowed: "
    )
    assert ended.returncode != 0 and ended.stderr.splitlines()[-1].startswith(message)
