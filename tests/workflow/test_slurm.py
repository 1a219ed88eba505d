"""The profile for Slurm, on two nodes on this machine: the same bytes as without it, in
few jobs, and more memory after a kill.

Daemons are started only where somebody asks for it by ELASTOCAL_SLURM=1, as CI does: a
developer's machine is no cluster.
"""

import os
import shutil
import socket
import subprocess
import sys
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path

import pytest
from durations import HUNG_S
from study_folder import REPOSITORY, Study

NODES = ("node1", "node2")
# Where Slurm's commands look inside of a job, whose environment the plugin clears of
# Slurm's variables.
_SYSTEM = Path("/etc/slurm/slurm.conf")
_PATH = f"{os.environ['PATH']}:/usr/sbin"
_ABSENT = [
    name
    for name in ("munged", "slurmctld", "slurmd", "sbatch")
    if not shutil.which(name, path=_PATH)
]
# Each node is a daemon with its own port. It claims four cores, whatever the machine has.
_NODE = (
    "NodeName={name} NodeHostname={host} NodeAddr=127.0.0.1 Port={port} CPUs=4"
    " RealMemory={megabytes} State=UNKNOWN\n"
)
# It needs root, whose jobs other users are, and a machine without a Slurm of its own.
_CANNOT = (
    os.environ.get("ELASTOCAL_SLURM") != "1"
    or _ABSENT
    or _SYSTEM.exists()
    or os.geteuid() != 0
)
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        bool(_CANNOT),
        reason=f"no Slurm: not asked for by ELASTOCAL_SLURM=1, no root, or not found: {_ABSENT}",
    ),
]
# Without a database of accounts squeue is what knows of jobs; a cluster of one machine
# answers at once.
ONE_MACHINE = (
    *(
        "--slurm-no-account",
        "--slurm-status-command",
        "squeue",
        "--slurm-init-seconds-before-status-checks",
        "2",
    ),
    *("--seconds-between-status-checks", "1", "--latency-wait", "5"),
)
# From seeds to compliances: each job on Slurm begins with some seconds of Snakemake. A
# job of Slurm for each, so that they run beside one another, on both nodes, from data
# that one of these wrote.
TARGETS = (
    "results/identified/kuka/0um/6DoF.parquet",
    "results/identified/kuka/200um/6DoF.parquet",
)
# The first attempt holds its memory until Slurm, which looks each second, has killed
# it; before its time is over, 2 minutes.
NEEDS_MORE = """
rule needs_more:
    output: "made.txt"
    resources: mem_mb=lambda wildcards, attempt: attempt * 500
    params: seconds=lambda wildcards, resources: 60 if resources.mem_mb == 500 else 0
    shell: "{python} -c 'import time; held = bytearray(450_000_000);"
        " time.sleep({{params.seconds}})'"
        " && echo {{resources.mem_mb}} > {{output}}"
"""


@pytest.fixture(scope="module")
def cluster():
    """Start the daemons, yield the environment of their clients, stop the daemons."""
    with ExitStack() as stack:
        # Names of sockets must be short, and munge asks for a folder that others can
        # read and nobody else can write.
        folder = Path(
            stack.enter_context(tempfile.TemporaryDirectory(prefix="slurm", dir="/tmp"))
        )
        folder.chmod(0o755)
        with ExitStack() as sockets:
            bound = [
                sockets.enter_context(socket.create_server(("127.0.0.1", 0)))
                for _ in range(1 + len(NODES))
            ]
            control_port, *ports = [
                bound_socket.getsockname()[1] for bound_socket in bound
            ]
        machine = {"host": socket.gethostname().partition(".")[0]}
        text = Path(__file__).with_name("slurm.conf").read_text(encoding="utf-8")
        text = text.format(
            port=control_port, folder=folder, ended="ended.txt", **machine
        )
        machine["megabytes"] = (
            os.sysconf("SC_PAGE_SIZE")
            * os.sysconf("SC_PHYS_PAGES")
            // 2**20
            // len(NODES)
        )
        text += "".join(
            _NODE.format(name=name, port=port, **machine)
            for name, port in zip(NODES, ports, strict=True)
        )
        (folder / "slurm.conf").write_text(text, encoding="utf-8")
        _SYSTEM.parent.mkdir(exist_ok=True)
        _SYSTEM.symlink_to(folder / "slurm.conf")
        stack.callback(_SYSTEM.unlink)
        for name in ("state", *(f"spool-{node}" for node in NODES)):
            (folder / name).mkdir()
        (folder / "munge.key").touch(mode=0o400)
        (folder / "munge.key").write_bytes(os.urandom(128))
        environment = os.environ | {
            "PATH": _PATH,
            "SLURM_CONF": str(folder / "slurm.conf"),
        }

        def start(*command):
            log = stack.enter_context((folder / f"{command[0]}.log").open("ab"))
            both = {"stdout": log, "stderr": subprocess.STDOUT}
            # Of its own session, so that an interrupt of the tests reaches it only
            # through its end here.
            process = subprocess.Popen(
                command, cwd=folder, env=environment, **both, start_new_session=True
            )
            stack.callback(process.wait)
            stack.callback(process.terminate)

        munge = [
            f"--{name}-file={folder}/munge.{name}"
            for name in ("key", "pid", "log", "seed")
        ]
        start(
            "munged",
            "--foreground",
            "--force",
            f"--socket={folder}/munge.socket",
            *munge,
        )
        _wait((folder / "munge.socket").exists)
        start("slurmctld", "-D")
        for node in NODES:
            start("slurmd", "-D", "-N", node)
        states = ["sinfo", "--noheader", "--Node", "--format=%t"]
        _wait(
            lambda: (
                subprocess.run(
                    states, env=environment, capture_output=True
                ).stdout.split()
                == [b"idle"] * len(NODES)
            )
        )
        yield environment
        subprocess.run(["scancel", "--user=root"], env=environment, capture_output=True)


def _wait(ready):
    end = time.monotonic() + HUNG_S
    while not ready():
        assert time.monotonic() < end
        time.sleep(0.1)


def on_slurm(folder, environment, *arguments):
    profile = REPOSITORY / "profiles" / "slurm"
    called = [
        sys.executable,
        "-m",
        "snakemake",
        "--profile",
        str(profile),
        *ONE_MACHINE,
        *arguments,
    ]
    done = subprocess.run(
        called,
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        timeout=HUNG_S,
    )
    assert done.returncode == 0, done.stderr[-3000:]
    return done.stdout + done.stderr


def contents(study):
    names = study.files("data/**/*.parquet", "results/**/*.parquet")
    return {name: study.path(name).read_bytes() for name in names}


def test_a_study_on_two_nodes_is_byte_for_byte_that_of_one_machine_and_in_few_jobs(
    cluster, tmp_path
):
    first, second = (Study.of_sources(tmp_path / name) for name in ("here", "there"))
    for study in (first, second):
        study.configure(
            {"robots": ["kuka"], "strategies": ["6DoF"], "noise_um": [0, 200]}
        )
    first.run(*TARGETS)
    environment = cluster | {
        "PYTHONPATH": str(second.folder / "src"),
        "OMP_NUM_THREADS": "1",
    }
    said = on_slurm(
        second.folder, environment, *TARGETS, "--group-components", "robot=10", "cell=1"
    )
    made = contents(first)
    assert made.keys() > set(TARGETS) and len(made) > 4
    assert contents(second) == made
    submitted = said.count("has been submitted with SLURM jobid")
    jobs = len(second.files("results/logs/**/*.log"))
    assert len(NODES) <= submitted <= jobs / 2
    ended = (
        Path(cluster["SLURM_CONF"]).with_name("ended.txt").read_text(encoding="utf-8")
    )
    assert all(f" NodeList={node} " in ended for node in NODES)


def test_a_job_that_slurm_killed_for_its_memory_runs_again_with_more(cluster, tmp_path):
    (tmp_path / "Snakefile").write_text(
        NEEDS_MORE.format(python=sys.executable), encoding="utf-8"
    )
    on_slurm(tmp_path, cluster, "made.txt")
    assert (tmp_path / "made.txt").read_text(encoding="utf-8") == "1000\n"
