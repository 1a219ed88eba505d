"""Fault injection: a plain `snakemake -j2` must recover from killed processes and from
two runs at once.

`make soak` injects forty kills. After each fault a plain run must finish, and every file
of the pipeline must be identical to that of an undisturbed run. A kill happens when a
run has made a given number of files, up to the number of files of the undisturbed run. A
given time would not do, because a fast machine could have finished by then.

Usage: python tests/faults/soak.py [--kills 40] [--seed 1]
"""

import argparse
import hashlib
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from contextlib import suppress
from pathlib import Path

import psutil

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "helpers"))

from study_folder import SMALL, Study

VICTIMS = ("job", "snakemake", "group")
OUTPUT_FOLDERS = ("data", "results", "reports")
# Outputs that differ between runs: they contain times.
VARYING = ("results/logs/", "results/timings/", "results/records/")
# Configuration of the part of the study that is run: some seconds with enough jobs in
# sequence and in parallel.
CHANGES = SMALL | {
    "robots": ["kuka", "kuka_extended"],
    "noise_um": [0, 200],
    "data_sets": 300,
}
TARGETS = """
        "results/metrics/kuka/200um/6DoF.parquet",
        "results/metrics/kuka/0um/6DoF.parquet",
        "reports/tables/table1.csv",
        "reports/tables/table2.csv",
        lambda wildcards: files_behind(rules.all.input),
"""


def make_study(folder):
    """Copy the sources, with a part of the study as the default target."""
    study = Study.of_sources(folder)
    study.configure(CHANGES)
    study.replace(
        "Snakefile",
        "        rules.paper.input,\n        rules.main_loops.input,\n",
        TARGETS.lstrip("\n"),
    )
    return study


def digest_outputs(study):
    """Return the digest of each file that jobs write, except for logs, timings and
    records."""
    digests = {}
    for name in OUTPUT_FOLDERS:
        for path in study.path(name).rglob("*"):
            relative = path.relative_to(study.folder).as_posix()
            if path.is_file() and not relative.startswith(VARYING):
                digests[relative] = hashlib.sha256(path.read_bytes()).hexdigest()
    return digests


def remove_outputs(study):
    """Restore the folder as it was before the first run."""
    for name in (*OUTPUT_FOLDERS, ".snakemake"):
        shutil.rmtree(study.path(name), ignore_errors=True)


def count_files(study):
    """Count the files that runs make, including Snakemake's own."""
    # Folders and files that disappear during the count are not counted.
    return sum(
        len(names)
        for folder in (*OUTPUT_FOLDERS, ".snakemake")
        for _, _, names in os.walk(study.path(folder))
    )


def start_run(study, files=0):
    """Start a plain run in its own process group, and return it when it has made a
    number of files or has ended."""
    run = subprocess.Popen(
        **study.command("-j2"),
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    while count_files(study) < files and run.poll() is None:
        time.sleep(0.005)
    return run


def run_to_the_end(study):
    """Run Snakemake, and check that it finishes."""
    finished = study.snakemake("-j2")
    output = finished.stdout[-2000:] + finished.stderr[-2000:]
    assert finished.returncode == 0, output


def kill(run, victim, rng):
    """Kill one job of a run, drawn at random, Snakemake itself, or its process group."""
    # A job that has ended in the meantime is not hit, and its run succeeds.
    with suppress(psutil.NoSuchProcess, IndexError):
        if victim == "group":
            os.killpg(run.pid, signal.SIGKILL)
        elif victim == "snakemake":
            run.kill()
        else:
            jobs = psutil.Process(run.pid).children(recursive=True)
            rng.choice(jobs).kill()


def disturb_run(study, victim, largest_count, rng):
    """Start runs until one has been killed.

    Parameters
    ----------
    study : Study
    victim : "job", "snakemake" or "group"
    largest_count : int
        The number of files at which a run is killed is below this one.
    rng : random.Random
        Draws the number of files and the job.

    Returns
    -------
    int
        Number of files at which the run was killed.
    """
    code = 0
    while code == 0:
        remove_outputs(study)
        files = rng.choice(range(largest_count))
        run = start_run(study, files)
        is_running = run.poll() is None
        if is_running:
            kill(run, victim, rng)
        code = run.wait()
        assert is_running or code == 0, f"a run that was not killed ended with {code}"
    return files


def run_twice_at_once(study, lag):
    """Start a second run when the first has made `lag` files, and return both exit
    codes. Snakemake may refuse one of the runs."""
    remove_outputs(study)
    first = start_run(study, lag)
    second = start_run(study)
    codes = first.wait(), second.wait()
    assert 0 in codes, codes
    return codes


def soak(folder, kills, seed):
    """Inject all faults, and print a line for each."""
    rng = random.Random(seed)
    study = make_study(Path(folder) / "study")
    run_to_the_end(study)
    expected = digest_outputs(study)
    files = count_files(study)
    print(
        f"undisturbed: {files} files, {len(expected)} of them to be identical",
        flush=True,
    )
    counts = dict.fromkeys(VICTIMS, 0)
    for number in range(kills):
        victim = VICTIMS[number % 3]
        files_at_kill = disturb_run(study, victim, files, rng)
        counts[victim] += 1
        run_to_the_end(study)
        assert digest_outputs(study) == expected, (victim, files_at_kill)
        print(
            f"{number + 1}: {victim} killed at {files_at_kill} files, finished,"
            " identical",
            flush=True,
        )
    for lag in (0, 1, files // 2):
        codes = run_twice_at_once(study, lag)
        run_to_the_end(study)
        assert digest_outputs(study) == expected
        print(f"two runs {lag} files apart: exit codes {codes}, identical", flush=True)
    print(f"kills survived: {counts}")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--kills", type=int, default=40)
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as top:
        soak(top, arguments.kills, arguments.seed)
