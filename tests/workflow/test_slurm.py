"""The profile for Slurm, on a Slurm of this machine: the same bytes as without it, in few jobs, and more memory after a kill.

Daemons are started only where somebody asks for it by ELASTOCAL_SLURM=1, as CI does: a developer's machine is no cluster.
"""

import os
import subprocess
import sys

import pytest
from slurm_on_one_machine import missing, slurm_on_one_machine
from study_folder import REPOSITORY, Study

pytestmark = pytest.mark.skipif(
    os.environ.get("ELASTOCAL_SLURM") != "1" or bool(missing()),
    reason=f"no Slurm: {missing() or 'ELASTOCAL_SLURM=1 starts one'}",
)
# Without a database of accounts squeue is what knows of jobs; a cluster of one machine answers at once.
ONE_MACHINE = (
    *("--slurm-no-account", "--slurm-status-command", "squeue", "--slurm-init-seconds-before-status-checks", "2"),
    *("--seconds-between-status-checks", "1", "--latency-wait", "5"),
)
TINY = {"robots": ["kuka"], "strategies": ["6DoF"], "noise_um": [200]}
# From seeds to compliances: each job on Slurm begins with some seconds of Snakemake.
TARGET = "results/identified/kuka/200um/6DoF.parquet"
NEEDS_MORE = """
rule needs_more:
    output: "made.txt"
    resources: mem_mb=lambda wildcards, attempt: attempt * 500
    shell: "{python} -c 'import time; held = bytearray(450_000_000); time.sleep(6)' && echo {{resources.mem_mb}} > {{output}}"
"""


@pytest.fixture(scope="module")
def cluster():
    with slurm_on_one_machine() as environment:
        yield environment


def on_slurm(folder, environment, *arguments):
    profile = REPOSITORY / "profiles" / "slurm"
    called = [sys.executable, "-m", "snakemake", "--profile", str(profile), *ONE_MACHINE, *arguments]
    return subprocess.run(called, cwd=folder, env=environment, capture_output=True, text=True, timeout=200)


def contents(study):
    names = study.files("data/**/*.parquet", "results/**/*.parquet")
    return {name: study.path(name).read_bytes() for name in names}


def test_a_study_on_slurm_is_byte_for_byte_that_of_one_machine_and_in_few_jobs(cluster, tmp_path):
    here, there = (Study.of_sources(tmp_path / name) for name in ("here", "there"))
    for study in (here, there):
        study.configure(TINY)
    here.run(TARGET)
    environment = cluster | {"PYTHONPATH": str(there.folder / "src"), "OMP_NUM_THREADS": "1"}
    done = on_slurm(there.folder, environment, TARGET)
    assert done.returncode == 0, done.stderr[-3000:]
    made = contents(here)
    assert TARGET in made and len(made) > 3
    assert contents(there) == made
    submitted = (done.stdout + done.stderr).count("has been submitted with SLURM jobid")
    records = len(there.files("results/jobs/**/*.json"))
    assert 1 <= submitted <= records / 2


def test_a_job_that_slurm_killed_for_its_memory_runs_again_with_more(cluster, tmp_path):
    (tmp_path / "Snakefile").write_text(NEEDS_MORE.format(python=sys.executable), encoding="utf-8")
    done = on_slurm(tmp_path, cluster, "made.txt")
    assert done.returncode == 0, done.stderr[-3000:]
    assert (tmp_path / "made.txt").read_text(encoding="utf-8") == "1000\n"
