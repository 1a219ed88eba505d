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
from analysed_robots import analysed
from made_folders import make_folder
from study_folder import REPOSITORY, Study
from supervised import Supervisor

NODES = ("node1", "node2")
# Within these seconds daemons are up, and a test ends: `make test-slurm` has ten minutes.
STARTED_S = 60
ENDED_S = 240
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
# Campaigns of an array of jobs.
ARRAY = ("first", "second")
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
    """Start the daemons, yield the environment of their clients, stop the daemons.

    They end with the tests, however those end.
    """
    # Names of sockets must be short, and munge asks for a folder that others can read
    # and nobody else can write.
    folder = Path(tempfile.mkdtemp(prefix="slurm", dir="/tmp"))
    supervisor = Supervisor(_SYSTEM, folder)
    try:
        _write_configuration(folder)
        environment = os.environ | {
            "PATH": _PATH,
            "SLURM_CONF": str(folder / "slurm.conf"),
        }
        _start_daemons(supervisor, folder, environment)
        yield environment
    finally:
        supervisor.end()


def _write_configuration(folder):
    """Write slurm.conf, the key of munge and the folders of the daemons."""
    folder.chmod(0o755)
    with ExitStack() as sockets:
        bound = [
            sockets.enter_context(socket.create_server(("127.0.0.1", 0)))
            for _ in range(1 + len(NODES))
        ]
        control_port, *ports = [bound_socket.getsockname()[1] for bound_socket in bound]
    machine = {"host": socket.gethostname().partition(".")[0]}
    text = Path(__file__).with_name("slurm.conf").read_text(encoding="utf-8")
    text = text.format(port=control_port, folder=folder, ended="ended.txt", **machine)
    pages = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    machine["megabytes"] = pages // 2**20 // len(NODES)
    text += "".join(
        _NODE.format(name=name, port=port, **machine)
        for name, port in zip(NODES, ports, strict=True)
    )
    (folder / "slurm.conf").write_text(text, encoding="utf-8")
    _SYSTEM.parent.mkdir(exist_ok=True)
    _SYSTEM.symlink_to(folder / "slurm.conf")
    for name in ("state", *(f"spool-{node}" for node in NODES)):
        (folder / name).mkdir()
    (folder / "munge.key").touch(mode=0o400)
    (folder / "munge.key").write_bytes(os.urandom(128))


def _start_daemons(supervisor, folder, environment):
    """Start munged, slurmctld and a slurmd for each node, and wait until nodes are idle."""
    munge = [
        f"--{name}-file={folder}/munge.{name}" for name in ("key", "pid", "log", "seed")
    ]
    munge_socket = f"--socket={folder}/munge.socket"
    commands = [
        ["munged", "--foreground", "--force", munge_socket, *munge],
        ["slurmctld", "-D"],
        *(["slurmd", "-D", "-N", node] for node in NODES),
    ]
    for command in commands:
        path = shutil.which(command[0], path=_PATH)
        log = folder / f"{command[0]}.log"
        supervisor.start([path, *command[1:]], environment, log)
        _wait((folder / "munge.socket").exists)
    states = ["sinfo", "--noheader", "--Node", "--format=%t"]
    _wait(
        lambda: (
            subprocess.run(states, env=environment, capture_output=True).stdout.split()
            == [b"idle"] * len(NODES)
        )
    )


def _wait(ready):
    end = time.monotonic() + STARTED_S
    while not ready():
        assert time.monotonic() < end
        time.sleep(0.1)


def run_client(command, folder, environment):
    """Run a command that uses Slurm; it ends with the tests.

    If it fails or takes too long, the message has its output and the state of Slurm.
    """
    output = folder / "client.log"
    with output.open("w", encoding="utf-8") as log:
        process = subprocess.Popen(
            ["setpriv", "--pdeathsig", "KILL", *map(str, command)],
            cwd=folder,
            env=environment,
            stdout=log,
            stderr=subprocess.STDOUT,
        )
        try:
            code = process.wait(ENDED_S)
        except subprocess.TimeoutExpired:
            code = f"none after {ENDED_S} s"
            process.kill()
            process.wait()
    said = output.read_text(encoding="utf-8")
    assert code == 0, f"exit code: {code}\n{said[-6000:]}\n{describe(environment)}"
    return said


def describe(environment):
    """What Slurm says of its jobs and nodes."""
    commands = (["squeue", "--long"], ["sinfo", "--Node", "--long"])
    states = (
        subprocess.run(command, env=environment, capture_output=True, text=True)
        for command in commands
    )
    return "".join(state.stdout + state.stderr for state in states)


def on_slurm(folder, environment, *arguments):
    profile = REPOSITORY / "profiles" / "slurm"
    command = [sys.executable, "-m", "snakemake", "--profile", profile, *ONE_MACHINE]
    return run_client([*command, *arguments], folder, environment)


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


def test_an_array_of_jobs_diagnoses_a_campaign_each(cluster, tmp_path):
    """By the script of docs/cluster.md, with the command that an environment has."""
    study = Study.of_sources(tmp_path / "study")
    folders = [
        make_folder(tmp_path / name, analysed("kuka"), name=name) for name in ARRAY
    ]
    (tmp_path / "folders.txt").write_text("".join(f"{folder}\n" for folder in folders))
    environment = cluster | {
        "PATH": f"{Path(sys.executable).parent}:{_PATH}",
        "PYTHONPATH": str(study.folder / "src"),
    }
    script = REPOSITORY / "workflow" / "examples" / "diagnose_array.sh"
    array = ["--wait", f"--array=1-{len(ARRAY)}", script, tmp_path / "folders.txt"]
    run_client(["sbatch", *array], study.folder, environment)
    for name in ARRAY:
        assert (study.folder / "reports/loop" / name / "report.pdf").stat().st_size
