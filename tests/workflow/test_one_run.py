"""Before any job: locks of killed runs are taken away, those of living ones stay, and a disk that is full is said."""

import subprocess
import sys
import time

import pytest
from support import refused

from one_run import JOBS, RUNS, begin

_HOLD = """
import fcntl, sys, time
with open(sys.argv[1], "a") as file:
    fcntl.flock(file, fcntl.LOCK_SH)
    print("held", flush=True)
    time.sleep(60)
"""


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "locks").mkdir()
    (tmp_path / "locks/0.output.lock").write_text("results/a.csv\n")
    return tmp_path


def holding(path):
    process = subprocess.Popen([sys.executable, "-c", _HOLD, path], stdout=subprocess.PIPE, text=True)
    assert process.stdout.readline() == "held\n"
    return process


def test_locks_of_a_run_that_was_killed_are_taken_away(folder):
    run = holding(folder / RUNS)
    run.kill()
    run.wait()
    with begin(folder, []):
        assert list((folder / "locks").iterdir()) == []


def test_locks_of_a_living_run_stay(folder):
    run = holding(folder / RUNS)
    with begin(folder, []):
        assert len(list((folder / "locks").iterdir())) == 1
    run.kill()
    run.wait()


def test_jobs_that_a_killed_run_left_behind_are_waited_for(folder, capfd):
    job = holding(folder / JOBS)
    waiting = subprocess.Popen(
        [sys.executable, "-c", f"from one_run import begin; from pathlib import Path; begin(Path({str(folder)!r}), [])"],
        env={"PYTHONPATH": ":".join(path for path in sys.path if path)},
    )
    time.sleep(1.5)
    assert waiting.poll() is None and len(list((folder / "locks").iterdir())) == 1
    job.kill()
    assert waiting.wait(timeout=20) == 0
    assert list((folder / "locks").iterdir()) == []
    assert "waiting for the jobs" in capfd.readouterr().out


def test_a_place_that_cannot_be_written_to_is_one_line(folder):
    (folder / "file").write_text("")
    with refused(f"{folder}/file/results", "", "Not a directory", "may write"):
        begin(folder, [f"{folder}/file/results"])
    with refused("/proc/elastocal", "", "may write"):
        begin(folder, ["/proc/elastocal"])
