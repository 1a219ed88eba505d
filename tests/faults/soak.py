"""Kills, and two runs at once: a plain `snakemake -j2` has to get over each.

`make soak` runs it with forty kills. After each fault a plain run has to finish, and
every file that the pipeline makes has to be, byte for byte, that of a run that nothing
disturbed. No moment is a time, by which a fast machine may have ended: kills come when
a run has made so many files, of as many as the undisturbed one made.

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
MADE = ("data", "results", "reports")
# What a part of the study is made of; enough jobs after and beside one another, in some
# seconds.
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


def part_of_the_study(folder):
    """Sources whose default target is a part of the study."""
    study = Study.of_sources(folder)
    study.configure(CHANGES)
    study.replace(
        "Snakefile",
        "        rules.paper.input,\n        rules.main_loops.input,\n",
        TARGETS.lstrip("\n"),
    )
    return study


def contents(study):
    """Digest of each file that jobs write, but for logs and what says how long jobs
    took."""
    files = [p for name in MADE for p in study.path(name).rglob("*") if p.is_file()]
    named = {p.relative_to(study.folder).as_posix(): p for p in files}
    return {
        name: hashlib.sha256(path.read_bytes()).hexdigest()
        for name, path in named.items()
        if not name.startswith(
            ("results/logs/", "results/timings/", "results/records/")
        )
    }


def cleared(study):
    """As before the first run."""
    for name in (*MADE, ".snakemake"):
        shutil.rmtree(study.path(name), ignore_errors=True)


def files_made(study):
    """How many files there are that runs make, what they note for themselves
    included."""
    # Folders and files that go while they are counted are not counted.
    return sum(
        len(names)
        for made in (*MADE, ".snakemake")
        for _, _, names in os.walk(study.path(made))
    )


def started(study, files=0):
    """A plain run in a process group of its own, under way to its end once there are so
    many files."""
    run = subprocess.Popen(
        **study.command("-j2"),
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    while files_made(study) < files and run.poll() is None:
        time.sleep(0.005)
    return run


def ended_by_itself(study):
    """Last lines of a plain run that has to finish."""
    done = study.snakemake("-j2")
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]


def killed(study, victim, moments, draws):
    """Kill a part of a run at one of the moments, drawn again until there was something
    to kill; the moment, in files.

    `victim`: one of "job", "snakemake", "group". `draws`: chooses the job.
    """
    code = 0
    while code == 0:
        cleared(study)
        files = draws.choice(moments)
        run = started(study, files)
        hit = run.poll() is None
        # A job that has ended meanwhile is not hit, and its run ends well.
        with suppress(psutil.NoSuchProcess, IndexError):
            if hit and victim == "group":
                os.killpg(run.pid, signal.SIGKILL)
            elif hit:
                (
                    run
                    if victim == "snakemake"
                    else draws.choice(psutil.Process(run.pid).children(recursive=True))
                ).kill()
        code = run.wait()
        assert hit or code == 0, f"a run that nobody killed ended with {code}"
    return files


def soak(folder, kills, seed):
    """All of it, said line by line."""
    draws = random.Random(seed)
    study = part_of_the_study(Path(folder) / "study")
    ended_by_itself(study)
    expected = contents(study)
    files = files_made(study)
    print(
        f"undisturbed: {files} files, {len(expected)} of them to be identical",
        flush=True,
    )
    counts = dict.fromkeys(VICTIMS, 0)
    for number in range(kills):
        victim = VICTIMS[number % 3]
        at = killed(study, victim, range(files), draws)
        counts[victim] += 1
        ended_by_itself(study)
        assert contents(study) == expected, (victim, at)
        print(
            f"{number + 1}: {victim} killed at {at} files, finished, identical",
            flush=True,
        )
    for apart in (0, 1, files // 2):
        # The second starts when the first has made so many files. One of them may be
        # refused; what they leave is that of one.
        cleared(study)
        first = started(study, apart)
        second = started(study)
        codes = first.wait(), second.wait()
        assert 0 in codes, codes
        ended_by_itself(study)
        assert contents(study) == expected
        print(
            f"two runs {apart} files apart: exit codes {codes}, identical", flush=True
        )
    print(f"kills survived: {counts}")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--kills", type=int, default=40)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as top:
        soak(top, given.kills, given.seed)
