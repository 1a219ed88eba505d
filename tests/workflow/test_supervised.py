"""Daemons that the tests start end with the tests, however those end."""

import signal
import subprocess
import sys
import time
from pathlib import Path

import psutil
import pytest
from support import heed_interrupts

HELPERS = Path(__file__).resolve().parents[1] / "helpers"
# A daemon that leaves a child in a session of its own, as Slurm's do for jobs; it notes both.
DAEMON = (
    "setsid sh -c 'trap \"\" TERM; echo $$ >> pids; sleep 600' & echo $$ >> pids; wait"
)
# Tests with such a daemon, at work until they are killed.
TESTS = """
import os, sys, time
from pathlib import Path
from supervised import Supervisor
folder = Path(sys.argv[1])
supervisor = Supervisor(folder.with_name("link"), folder, ending_s=0.3)
supervisor.start(["sh", "-c", sys.argv[2]], {**os.environ}, folder / "log")
if sys.argv[3] == "0":
    while len((folder / "pids").read_text().split() if (folder / "pids").exists() else "") < 2:
        time.sleep(0.05)
    supervisor.end()
time.sleep(600)
"""


@pytest.mark.parametrize(
    "number", [signal.SIGKILL, signal.SIGTERM, signal.SIGINT, None], ids=str
)
def test_no_daemon_and_no_job_of_one_is_left(tmp_path, number):
    """Neither after a kill of the tests nor after their own end."""
    folder = tmp_path / "folder"
    folder.mkdir()
    (tmp_path / "link").symlink_to(folder)
    command = [sys.executable, "-c", TESTS, folder, DAEMON, str(int(number or 0))]
    environment = {"PYTHONPATH": str(HELPERS), "PATH": "/usr/bin:/bin"}
    with subprocess.Popen(
        command, env=environment, preexec_fn=heed_interrupts
    ) as tests:
        if number is not None:
            pids = _wait_for_two(folder / "pids")
            tests.send_signal(number)
        else:
            pids = []
            _wait_until_gone(folder)
            tests.kill()
    _wait_until_gone(folder)
    assert not (tmp_path / "link").is_symlink()
    assert not [pid for pid in pids if psutil.pid_exists(pid)]


def _wait_for_two(file):
    while True:
        words = file.read_text().split() if file.exists() else []
        if len(words) == 2:
            return [*map(int, words)]
        time.sleep(0.05)


def _wait_until_gone(folder):
    end = time.monotonic() + 60
    while folder.exists():
        assert time.monotonic() < end
        time.sleep(0.05)
