"""The next reader notices a file that was altered, is missing or has no record, and any
file that it was made from."""

import json
import subprocess
import sys
from pathlib import Path

import pytest
from support import refused

from elastocal.errors import InputError
from elastocal.io.origin import Origin
from elastocal.io.records import (
    JobRecord,
    digest_inputs,
    list_recorded_files,
    list_recorded_outputs,
    locate_record,
    read_record,
    trace_jobs,
    write_records,
)

ORIGIN = Origin("c0ffee", "d16e57", 1)
HERE = {"numpy": "2.0"}
MEASURED = "data/sealed/block"
FITTED = "results/fit.json"
TABLE = "results/fit.csv"
DRAWN = "reports/drawn.png"
CODE = "src/fit.py"
USERS_FILE = "data/mine.csv"
ALTERED = {
    MEASURED: f"{MEASURED}/2/case.json",
    FITTED: FITTED,
    TABLE: TABLE,
    DRAWN: DRAWN,
}


def write(rule, number, inputs, outputs, checked=None):
    """Write the records of a job that was successful."""
    digests, users_inputs = digest_inputs(inputs, checked)
    job = JobRecord(
        rule,
        {"robot": "kuka"},
        f"{number}",
        f"{number + 1}",
        digests,
        users_inputs,
        tuple(outputs),
        ORIGIN,
        HERE,
    )
    write_records(job)
    return job


@pytest.fixture(autouse=True)
def jobs(tmp_path, monkeypatch):
    """Record a chain of three jobs, from a file of the user to a figure, and a separate
    job; return the chain."""
    monkeypatch.chdir(tmp_path)
    for name in (
        CODE,
        USERS_FILE,
        f"{MEASURED}/1/case.json",
        f"{MEASURED}/2/case.json",
        FITTED,
        TABLE,
        DRAWN,
        "results/other.csv",
    ):
        Path(name).parent.mkdir(parents=True, exist_ok=True)
        Path(name).write_bytes(name.encode() + bytes(range(64)))
    chain = [
        write("measure", 1, [USERS_FILE, CODE], [MEASURED], checked=[CODE]),
        write("fit", 2, [MEASURED, CODE], [FITTED, TABLE]),
        write("draw", 3, [FITTED, CODE], [DRAWN, "docs/drawn.png"]),
    ]
    write("other", 4, [CODE], ["results/other.csv"])
    return chain


def test_a_file_is_traced_to_every_job_behind_it_and_to_no_other(jobs):
    assert trace_jobs([DRAWN]) == jobs
    assert trace_jobs([TABLE]) == jobs[:2]
    assert [job.name for job in jobs] == ["measure kuka", "fit kuka", "draw kuka"]


@pytest.mark.parametrize("position", [0, 30, -1])
@pytest.mark.parametrize("output", ALTERED)
def test_an_altered_byte_is_noticed_by_every_later_job(output, position):
    altered = Path(ALTERED[output])
    content = bytearray(altered.read_bytes())
    content[position] ^= 1
    altered.write_bytes(content)
    delete = f"(delete {'it' if output == ALTERED[output] else output}"
    with refused(altered.as_posix(), "", "other contents than were written", delete):
        digest_inputs([CODE, output])
    with refused(altered.as_posix(), "", "other contents than were written"):
        trace_jobs([DRAWN])


@pytest.mark.parametrize("output", ALTERED)
def test_a_missing_record_is_an_error(output):
    locate_record(output).unlink()
    with refused(
        output, "", f"no record of the job that made it, {locate_record(output)}"
    ):
        trace_jobs([DRAWN])
    with refused(output, "", "no record of the job that made it"):
        digest_inputs([output])


def test_a_file_that_changed_since_a_job_read_it_is_refused(jobs):
    Path(FITTED).write_text("another fit", encoding="utf-8")
    write_records(jobs[1])
    with refused(FITTED, "", "other contents than draw kuka read"):
        trace_jobs([DRAWN])


def test_an_altered_character_of_a_record_is_noticed():
    path = locate_record(FITTED)
    written = path.read_text(encoding="utf-8")
    altered = [
        written[:n] + chr(ord(c) ^ 1) + written[n + 1 :]
        for n, c in enumerate(written[:-1])
        if not c.isspace()
    ]
    for text in (
        *altered[::7],
        "",
        "{",
        "{}",
        "[]",
        json.dumps({"sha256": "", "files": 1}),
    ):
        path.write_text(text, encoding="utf-8")
        with pytest.raises(
            InputError,
            match=r"^results/records/results/fit\.json\.json: found no record of a job ",
        ):
            read_record(FITTED)


def test_a_folder_is_one_output_with_several_files():
    outputs = list_recorded_outputs()
    assert MEASURED in outputs and ALTERED[MEASURED] not in outputs
    files = [file for output in outputs for file in read_record(output)[1]]
    assert sorted(files) == sorted(list_recorded_files())


def test_sha256sum_checks_the_recorded_files():
    called = [sys.executable, "-m", "elastocal.io.records"]
    lines = subprocess.run(called, capture_output=True, text=True, check=True).stdout
    assert len(lines.splitlines()) == len(list_recorded_files()) == 6
    done = subprocess.run(
        ["sha256sum", "--check"], input=lines, capture_output=True, text=True
    )
    assert done.returncode == 0 and f"{FITTED}: OK\n" in done.stdout
