"""Before any job: locks of killed runs are taken away, those of living ones stay, and a
disk that is full is said."""

import fcntl
import subprocess
import sys

import pytest
from support import refused

from one_run import JOBS, RUNS, begin

_HOLD = """
import fcntl, sys
with open(sys.argv[1], "a") as file:
    fcntl.flock(file, fcntl.LOCK_SH)
    print("held", flush=True)
    sys.stdin.read()
"""


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "locks").mkdir()
    (tmp_path / "locks/0.output.lock").write_text("results/a.csv\n")
    return tmp_path


def holding(path):
    process = subprocess.Popen(
        [sys.executable, "-c", _HOLD, path],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert process.stdout.readline() == "held\n"
    return process


@pytest.mark.parametrize("living", [False, True])
def test_locks_of_a_run_that_was_killed_are_taken_away_and_those_of_a_living_one_stay(
    folder, living
):
    run = holding(folder / RUNS)
    if not living:
        run.kill()
        run.wait()
    with begin(folder, []):
        assert len(list((folder / "locks").iterdir())) == living
    run.kill()


def test_jobs_that_a_killed_run_left_behind_are_waited_for(folder, capfd, monkeypatch):
    """The job ends once it is waited for; until then the locks stay."""
    job = holding(folder / JOBS)
    flock = fcntl.flock
    states = []

    def waited(file, operation):
        if file.name == str(folder / JOBS) and operation == fcntl.LOCK_EX:
            states.append(
                (
                    len(list((folder / "locks").iterdir())),
                    job.poll(),
                    capfd.readouterr().out,
                )
            )
            job.kill()
        flock(file, operation)

    monkeypatch.setattr(fcntl, "flock", waited)
    with begin(folder, []):
        ((locks, ended, said),) = states
        assert (locks, ended) == (1, None) and "waiting for its jobs" in said
        assert list((folder / "locks").iterdir()) == []
        assert job.wait() != 0


def test_a_place_that_cannot_be_written_to_is_one_line(folder):
    (folder / "file").write_text("")
    with refused(f"{folder}/file/results", "", "Not a directory", "may write"):
        begin(folder, [f"{folder}/file/results"])
    with refused("/proc/elastocal", "", "may write"):
        begin(folder, ["/proc/elastocal"])
