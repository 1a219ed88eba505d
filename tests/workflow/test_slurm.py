"""The profile for Slurm, on two nodes on this machine: the same bytes as without it, in few jobs, and more memory after a kill.

Daemons are started only where somebody asks for it by ELASTOCAL_SLURM=1, as CI does: a developer's machine is no cluster.
"""

import os
import subprocess
import sys

import pytest
from durations import HUNG_S
from slurm_on_one_machine import NODES, ended_jobs, missing, slurm_on_one_machine
from study_folder import REPOSITORY, Study

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
