"""Run daemons for as long as the process that asked for them lives.

`python supervised.py LINK FOLDER SECONDS` reads from standard input one command a line,
as JSON with the file of its output. When the input ends, for whatever reason, it ends the
daemons with everything that they have started, after so many seconds by force, and
removes the link and the folder.
"""

import ctypes
import json
import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import psutil

# Orphans become children of this process, so that it finds those of an ended daemon
# (prctl(2)).
PR_SET_CHILD_SUBREAPER = 36
# Seconds in which a daemon of Slurm ends by itself.
ENDING_S = 3.0


class Supervisor:
    """The side of the process that asks for daemons."""

    def __init__(self, link, folder, ending_s=ENDING_S):
        # Its session is its own: an interrupt from the terminal does not reach it.
        self._process = subprocess.Popen(
            [sys.executable, __file__, str(link), str(folder), str(ending_s)],
            stdin=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )

    def start(self, command, environment, output):
        """Start a daemon, which writes to a file."""
        request = {"args": command, "env": environment, "output": str(output)}
        self._process.stdin.write(f"{json.dumps(request)}\n")
        self._process.stdin.flush()

    def end(self):
        """End all daemons, and wait until they have ended."""
        self._process.stdin.close()
        self._process.wait()


def _serve(link, folder, ending_s):
    ctypes.CDLL(None, use_errno=True).prctl(PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0)
    # Only the end of the input ends this process.
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    try:
        for line in sys.stdin:
            request = json.loads(line)
            with open(request.pop("output"), "ab") as output:
                subprocess.Popen(
                    **request,
                    cwd=folder,
                    stdout=output,
                    stderr=subprocess.STDOUT,
                    stdin=subprocess.DEVNULL,
                    preexec_fn=_heed_signals,
                )
    finally:
        _end_descendants(ending_s)
        link.unlink(missing_ok=True)
        shutil.rmtree(folder, ignore_errors=True)


def _heed_signals():
    """Undo in a daemon that signals are ignored."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_DFL)


def _end_descendants(ending_s):
    descendants = psutil.Process().children(recursive=True)
    for process in descendants:
        _send(process, signal.SIGTERM)
    psutil.wait_procs(descendants, timeout=ending_s)
    # A process that is killed may leave children, which are ours then.
    while descendants := psutil.Process().children(recursive=True):
        for process in descendants:
            _send(process, signal.SIGKILL)
        psutil.wait_procs(descendants, timeout=1)
        _collect_ended()


def _send(process, number):
    try:
        process.send_signal(number)
    except psutil.NoSuchProcess:
        return


def _collect_ended():
    """Take the exit codes of ended orphans, which else stay as zombies."""
    try:
        while os.waitpid(-1, os.WNOHANG)[0]:
            continue
    except ChildProcessError:
        return


if __name__ == "__main__":
    _serve(Path(sys.argv[1]), Path(sys.argv[2]), float(sys.argv[3]))
