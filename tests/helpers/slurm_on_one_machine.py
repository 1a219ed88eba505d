"""A Slurm of two nodes on one machine, for tests: daemons in a temporary folder, found by a link in /etc/slurm meanwhile."""

import os
import re
import shutil
import socket
import subprocess
import tempfile
import time
from contextlib import ExitStack, contextmanager
from pathlib import Path

from durations import HUNG_S

NODES = ("node1", "node2")
# Where Slurm's commands look inside of a job, whose environment the plugin clears of Slurm's variables.
_SYSTEM = Path("/etc/slurm/slurm.conf")
DAEMONS = ("munged", "slurmctld", "slurmd", "sbatch")
_CONFIGURATION = Path(__file__).with_suffix(".conf").read_text(encoding="utf-8")
# What Slurm writes on each job that has ended.
_ENDED = "ended.txt"
# Each node is a daemon with a port of its own.
_NODE = "NodeName={name} NodeHostname={host} NodeAddr=127.0.0.1 Port={port} CPUs={cores} RealMemory={megabytes} State=UNKNOWN\n"


def missing():
    """Why there can be no Slurm here, or nothing."""
    absent = [name for name in DAEMONS if not shutil.which(name, path=_path())]
    if absent:
        return f"{', '.join(absent)} not found: apt-get install slurmctld slurmd slurm-client munge"
    if _SYSTEM.exists():
        return f"{_SYSTEM} is there: this machine has a Slurm of its own"
    return "" if os.geteuid() == 0 else "Slurm's daemons start jobs as other users, so root must start them"


@contextmanager
def slurm_on_one_machine(cores=4):
    """Start the daemons, yield the environment of their clients, stop the daemons.

    `cores`: that jobs may have on each node, whatever the machine has.
    """
    with ExitStack() as stack:
        # Names of sockets must be short, and munge asks for a folder that others can read and nobody else can write.
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="slurm", dir="/tmp")))
        folder.chmod(0o755)
        host = socket.gethostname().partition(".")[0]
        megabytes = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") // 2**20 // len(NODES)
        own, *ports = _free_ports(1 + len(NODES))
        text = _CONFIGURATION.format(host=host, port=own, folder=folder, ended=_ENDED)
        for name, port in zip(NODES, ports, strict=True):
            text += _NODE.format(name=name, host=host, port=port, cores=cores, megabytes=megabytes)
        (folder / "slurm.conf").write_text(text, encoding="utf-8")
        _SYSTEM.parent.mkdir(exist_ok=True)
        _SYSTEM.unlink(missing_ok=True)
        _SYSTEM.symlink_to(folder / "slurm.conf")
        stack.callback(_SYSTEM.unlink)
        for name in ("state", *(f"spool-{node}" for node in NODES)):
            (folder / name).mkdir()
        environment = os.environ | {"PATH": _path(), "SLURM_CONF": str(folder / "slurm.conf")}
        _write_key(folder / "munge.key")
        munged = ["munged", "--foreground", "--force", f"--key-file={folder}/munge.key", f"--socket={folder}/munge.socket"]
        munged += [f"--{name}-file={folder}/munge.{name}" for name in ("pid", "log", "seed")]
        _start(munged, folder, environment, stack)
        _wait(lambda: (folder / "munge.socket").exists(), "munged")
        _start(["slurmctld", "-D"], folder, environment, stack)
        for node in NODES:
            _start(["slurmd", "-D", "-N", node], folder, environment, stack)
        states = ["sinfo", "--noheader", "--Node", "--format=%t"]
        _wait(
            lambda: (
                subprocess.run(states, env=environment, capture_output=True, text=True).stdout.split() == ["idle"] * len(NODES)
            ),
            "slurmd",
        )
        yield environment
        subprocess.run(["scancel", "--user=root"], env=environment, capture_output=True)


def ended_jobs(environment, folder):
    """Node and number of cores of each job that was submitted from a folder and has ended."""
    lines = Path(environment["SLURM_CONF"]).with_name(_ENDED).read_text(encoding="utf-8").splitlines()
    return [re.search(r" NodeList=(\S+) .* ProcCnt=(\d+)", line).groups() for line in lines if f" WorkDir={folder} " in line]


def _path():
    return f"{os.environ['PATH']}:/usr/sbin"


def _free_ports(count):
    with ExitStack() as stack:
        sockets = [stack.enter_context(socket.socket()) for _ in range(count)]
        for each in sockets:
            each.bind(("127.0.0.1", 0))
        return [each.getsockname()[1] for each in sockets]


def _write_key(file):
    file.touch(mode=0o400)
    file.write_bytes(os.urandom(128))


def _start(command, folder, environment, stack):
    log = stack.enter_context((folder / f"{command[0]}.log").open("ab"))
    # Of its own session, so that an interrupt of the tests reaches it only through its end here.
    process = subprocess.Popen(
        command, cwd=folder, env=environment, stdout=log, stderr=subprocess.STDOUT, start_new_session=True
    )
    stack.callback(process.wait)
    stack.callback(process.terminate)


def _wait(ready, name):
    end = time.monotonic() + HUNG_S
    while not ready():
        assert time.monotonic() < end, f"{name} has not started within {HUNG_S} s"
        time.sleep(0.1)
