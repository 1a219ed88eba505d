"""What every script does around its one call: whatever ends it, the log says why, and
bad input is one line."""

import errno
import hashlib
import json
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from study_folder import REPOSITORY

sys.path.insert(0, str(REPOSITORY / "workflow" / "scripts"))

from job import run

from elastocal.errors import InputError

INPUT = "own/a.csv"
OUTPUT = "results/b.csv"
SOURCE = "own/step.py"


def job_of(**files):
    origin = {"commit": "c0ffee", "configuration_sha256": "d16e57", "seed": 1}
    return SimpleNamespace(
        **files,
        params={"sources": (SOURCE,)},
        rule="copy",
        wildcards={"robot": "kuka"},
        config={"origin": origin},
    )


@pytest.fixture
def job(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for folder in ("own", "results/logs", ".snakemake"):
        (tmp_path / folder).mkdir(parents=True)
    (tmp_path / INPUT).write_text("1\n")
    (tmp_path / SOURCE).write_text("EDITED = False\n")
    return job_of(input=[INPUT], output=[OUTPUT], log=["results/logs/b.log"])


def log(job):
    return Path(job.log[0]).read_text(encoding="utf-8")


def copied(job):
    Path(job.output[0]).write_bytes(Path(job.input[0]).read_bytes())


def test_what_a_job_wrote_is_checked_by_the_next(job):
    run(copied, job)
    assert log(job) == "done\n"
    following = job_of(
        input=[OUTPUT], output=["results/c.csv"], log=["results/logs/c.log"]
    )
    run(copied, following)
    Path(OUTPUT).write_text("2\n")
    with pytest.raises(SystemExit):
        run(copied, following)
    refusal = f"{OUTPUT}: found other contents than were written; allowed: "
    assert log(following).startswith(refusal)
    assert len(log(following).splitlines()) == 1


@pytest.mark.parametrize(
    ("fault", "line"),
    [
        (InputError("a.csv", "row 1", "x", "y"), "a.csv: row 1: found x; allowed: y"),
        (
            OSError(errno.ENOSPC, "No space left on device"),
            f"{OUTPUT}: found No space left on device; allowed: a file or folder",
        ),
        (
            PermissionError(errno.EROFS, "Read-only file system", "results/x"),
            "results/x: found Read-only file system; ",
        ),
    ],
)
def test_bad_input_and_faults_of_the_machine_are_one_line(job, fault, line):
    def step(_):
        raise fault

    is_input = isinstance(fault, InputError)
    with pytest.raises(SystemExit) as ended:
        run(step, job)
    last_line = log(job).splitlines()[-1]
    assert last_line.startswith(line)
    # The logger repeats the line of bad input; a full disk may have no log.
    assert ended.value.code == (1 if is_input else last_line)
    assert ("Traceback" in log(job)) == (not is_input)


@pytest.mark.parametrize(
    "fault",
    [ZeroDivisionError("x"), KeyboardInterrupt(), RuntimeError("y"), SystemExit(3)],
)
def test_the_log_holds_the_traceback_of_anything_else(job, fault):
    def step(_):
        raise fault

    with pytest.raises(type(fault)):
        run(step, job)
    assert "Traceback" in log(job) and type(fault).__name__ in log(job).splitlines()[-1]


def test_a_job_that_ended_well_leaves_a_record_of_what_it_read_and_wrote_when_and_from_what(
    job,
):
    run(copied, job)
    record = json.loads(
        Path("results/records/results/b.csv.json").read_text(encoding="utf-8")
    )
    digest = hashlib.sha256(b"1\n").hexdigest()
    source_digest = hashlib.sha256(b"EDITED = False\n").hexdigest()
    assert (
        record["inputs"] == {INPUT: digest, SOURCE: source_digest}
        and record["outputs"] == [OUTPUT]
        and record["files"] == {OUTPUT: digest}
    )
    assert (
        record["environment"]["numpy"] == np.__version__
        and "requirements/run.lock" in record["environment"]
    )
    assert (record["rule"], record["wildcards"], record["origin"]) == (
        "copy",
        {"robot": "kuka"},
        job.config["origin"],
    )
    assert record["started"] <= record["ended"] and record["ended"].endswith("+00:00")
