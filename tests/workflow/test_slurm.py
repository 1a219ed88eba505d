"""The profile for Slurm, on two nodes on this machine: the same bytes as without it, in few jobs, and more memory after a kill.

Daemons are started only where somebody asks for it by ELASTOCAL_SLURM=1, as CI does: a developer's machine is no cluster.
"""

import os
import re
import shutil
import socket
import subprocess
import sys
import tempfile
import time
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest
from durations import HUNG_S
from study_folder import REPOSITORY, Study

NODES = ("node1", "node2")
# Where Slurm's commands look inside of a job, whose environment the plugin clears of Slurm's variables.
_SYSTEM = Path("/etc/slurm/slurm.conf")
DAEMONS = ("munged", "slurmctld", "slurmd", "sbatch")
_CONFIGURATION = Path(__file__).with_name("slurm.conf").read_text(encoding="utf-8")
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


pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        os.environ.get("ELASTOCAL_SLURM") != "1" or bool(missing()),
        reason=f"no Slurm: {missing() or 'ELASTOCAL_SLURM=1 starts one'}",
    ),
]
# Without a database of accounts squeue is what knows of jobs; a cluster of one machine answers at once.
ONE_MACHINE = (
    *("--slurm-no-account", "--slurm-status-command", "squeue", "--slurm-init-seconds-before-status-checks", "2"),
    *("--seconds-between-status-checks", "1", "--latency-wait", "5"),
)
TINY = {"robots": ["kuka"], "strategies": ["6DoF"], "noise_um": [0, 200]}
# From seeds to compliances: each job on Slurm begins with some seconds of Snakemake. A job of Slurm for each, so that they run
# beside one another, on both nodes, from data that one of these wrote.
TARGETS = ("results/identified/kuka/0um/6DoF.parquet", "results/identified/kuka/200um/6DoF.parquet")
ONE_EACH = ("--group-components", "robot=10", "cell=1")
# The first attempt holds its memory until Slurm, which looks each second, has killed it; before its time is over, 2 minutes.
NEEDS_MORE = """
rule needs_more:
    output: "made.txt"
    resources: mem_mb=lambda wildcards, attempt: attempt * 500
    params: seconds=lambda wildcards, resources: 60 if resources.mem_mb == 500 else 0
    shell: "{python} -c 'import time; held = bytearray(450_000_000); time.sleep({{params.seconds}})'"
        " && echo {{resources.mem_mb}} > {{output}}"
"""
# A rule of the profile's array jobs, whose file says which part of an array made it, and one of its groups. The first part
# waits for another, so that they run beside one another, and therefore on both nodes, whatever Slurm takes to start them.
LONG_AND_SHORT = """
rule all:
    input: expand("long/{number}.txt", number=range(4)), expand("short/{number}.txt", number=range(4))

rule simulate:
    output: "short/{number}.txt"
    shell: "touch {output}"

rule diagnose_cases:
    output: "long/{number}.txt"
    shell: "touch begun.{wildcards.number}; until [ $(ls begun.* | wc -l) -gt 1 ]; do sleep 0.1; done;"
        " echo $SLURM_ARRAY_TASK_ID > {output}"
"""


@pytest.fixture(scope="module")
def cluster():
    with slurm_on_one_machine() as environment:
        yield environment


def on_slurm(folder, environment, *arguments):
    profile = REPOSITORY / "profiles" / "slurm"
    called = [sys.executable, "-m", "snakemake", "--profile", str(profile), *ONE_MACHINE, *arguments]
    return subprocess.run(called, cwd=folder, env=environment, capture_output=True, text=True, timeout=HUNG_S)


def contents(study):
    names = study.files("data/**/*.parquet", "results/**/*.parquet")
    return {name: study.path(name).read_bytes() for name in names}


def test_a_study_on_two_nodes_is_byte_for_byte_that_of_one_machine_and_in_few_jobs(cluster, tmp_path):
    here, there = (Study.of_sources(tmp_path / name) for name in ("here", "there"))
    for study in (here, there):
        study.configure(TINY)
    here.run(*TARGETS)
    environment = cluster | {"PYTHONPATH": str(there.folder / "src"), "OMP_NUM_THREADS": "1"}
    done = on_slurm(there.folder, environment, *TARGETS, *ONE_EACH)
    assert done.returncode == 0, done.stderr[-3000:]
    made = contents(here)
    assert made.keys() > set(TARGETS) and len(made) > 4
    assert contents(there) == made
    submitted = (done.stdout + done.stderr).count("has been submitted with SLURM jobid")
    jobs = len(there.files("results/logs/**/*.log"))
    assert len(NODES) <= submitted <= jobs / 2
    assert {node for node, _ in ended_jobs(cluster, there.folder)} == set(NODES)


def test_long_jobs_are_parts_of_an_array_on_both_nodes_and_short_ones_share_a_job(cluster, tmp_path):
    (tmp_path / "Snakefile").write_text(LONG_AND_SHORT, encoding="utf-8")
    done = on_slurm(tmp_path, cluster, "all")
    assert done.returncode == 0, done.stderr[-3000:]
    parts = {(tmp_path / f"long/{number}.txt").read_text(encoding="utf-8").strip() for number in range(4)}
    assert parts == {"1", "2", "3", "4"}
    ended = ended_jobs(cluster, tmp_path)
    # The plugin runs the jobs of a group one after another: more than one core would stand idle.
    assert len(ended) == 5 and set(ended) == {(node, "1") for node in NODES}


def test_a_job_that_slurm_killed_for_its_memory_runs_again_with_more(cluster, tmp_path):
    (tmp_path / "Snakefile").write_text(NEEDS_MORE.format(python=sys.executable), encoding="utf-8")
    done = on_slurm(tmp_path, cluster, "made.txt")
    assert done.returncode == 0, done.stderr[-3000:]
    assert (tmp_path / "made.txt").read_text(encoding="utf-8") == "1000\n"
