"""While it works Snakemake says one line a job; at the end, reports and verdicts, or last of all why a job failed."""

import re
from collections import Counter

import pytest

IDENTIFIED = "results/identified/kuka/200um/6DoF.parquet"


def test_a_job_is_one_line_without_lists_of_files(finished):
    finished.path(IDENTIFIED).unlink()
    said = finished.run(IDENTIFIED).stderr.splitlines()
    assert "1 job" in said
    assert [line for line in said if line.startswith("1 of 1: identify")] == ["1 of 1: identify kuka 200 6DoF"]
    assert max(map(len, said)) < 200


def test_a_dry_run_is_a_summary_and_every_job_is_listed_on_request(unstarted):
    done = unstarted.snakemake("-n")
    assert done.returncode == 0, done.stderr
    first, *listed, last = done.stdout.splitlines()
    jobs = unstarted.planned()
    assert (
        first == f"{len(jobs)} jobs would run:" and last == "Nothing was run. `snakemake -n -p` lists every job with its files."
    )
    counts = re.findall(r"(\d+)\s+(\w+)", " ".join(listed))
    assert {rule: int(count) for count, rule in counts} == Counter(rule for rule, *_ in jobs)
    assert len(listed) < 25 and max(map(len, listed)) <= 80


@pytest.mark.parametrize(
    ("file", "line", "last"),
    [
        (
            "workflow/scripts/identify.py",
            "import none_of_this_name",
            "ModuleNotFoundError: No module named 'none_of_this_name'",
        ),
        ("src/elastocal/study/steps/identify.py", "1 / 0", "ZeroDivisionError: division by zero"),
    ],
    ids=["a package that is missing", "a module that is broken"],
)
def test_the_log_of_a_script_that_fails_while_it_imports_says_why(finished, file, line, last):
    finished.path(IDENTIFIED).unlink()
    head, imports = finished.path(file).read_text(encoding="utf-8").split("\nfrom elastocal", 1)
    finished.path(file).write_text(f"{head}\n{line}\nfrom elastocal{imports}", encoding="utf-8")
    ended = finished.snakemake("-j1", IDENTIFIED)
    assert ended.returncode != 0 and ended.stderr.splitlines()[-1] == last
    log = finished.path("results/logs/identify/kuka/200um/6DoF.log").read_text(encoding="utf-8").splitlines()
    assert log[0].startswith("Traceback") and log[-1] == last


@pytest.mark.parametrize(
    "file", ["workflow/scripts/identify.py", "workflow/scripts/job.py", "src/elastocal/effects/payload.py"]
)
def test_a_source_that_is_no_python_is_one_line(finished, file):
    finished.append(file, "half = (\n")
    ended = finished.snakemake("-j1", IDENTIFIED)
    said = ended.stderr.splitlines()
    assert ended.returncode != 0 and f"{file}: line " in said[-1] and said[-1].endswith("; allowed: Python")
    assert "Traceback" not in ended.stderr


def test_a_script_that_is_ended_before_it_begins_has_no_log_and_is_said_to_have_none(finished):
    finished.path(IDENTIFIED).unlink()
    finished.replace("workflow/scripts/identify.py", "from job import Job, run\n", "import os\n\nos._exit(9)\n")
    ended = finished.snakemake("-j1", IDENTIFIED)
    found = "identify: found an end before its log began (results/logs/identify/kuka/200um/6DoF.log); allowed: "
    assert ended.returncode != 0 and ended.stderr.splitlines()[-1].startswith(found)
