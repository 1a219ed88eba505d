"""Planning the jobs of a large study, against a Snakefile without anything of ours.

`bare.smk` has the rules of which a study has most jobs, with the same files. Both are
planned with few and with many noise levels; the difference is the cost of a job.
"""

import json
import os
import re
import shutil
import subprocess
import sys
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from common import ROOT, Row
from copies import copy_study

# One more job than its noise levels and strategies costs at most this many times as much
# as in the bare Snakefile, in CPU seconds and in memory.
TARGET = 1.5
BARE = ROOT / "benchmarks" / "bare.smk"
STUDY = {
    "robots": ["kuka", "kuka_extended"],
    "strategies": [
        path.stem for path in sorted((ROOT / "config" / "strategies").glob("*.yaml"))
    ],
}
# The level of the paper's tables and those of the ladder, which a study must have.
FIRST_LEVELS = [50, 200, 500]


@dataclass(frozen=True)
class Setting:
    """Numbers of noise levels, and the number of repetitions."""

    levels: tuple[int, int]
    repetitions: int


@dataclass(frozen=True)
class Plan:
    """What a dry run planned, and what that took."""

    jobs: int
    seconds: float
    peak_mb: float


FULL = Setting((20, 440), 2)
# With fewer levels the difference is below the scatter of two runs.
SMALL = Setting((3, 60), 1)


def rows(work: Path, setting: Setting) -> list[Row]:
    """Return the rows for time and for memory."""
    ours = copy_study(work / "planned")
    bare = work / "bare"
    bare.mkdir()
    shutil.copy(BARE, bare / "Snakefile")
    (bare / "touch.py").touch()
    targets = {ours: "study", bare: "all"}
    plans: dict[tuple[Path, int], list[Plan]] = defaultdict(list)
    for _ in range(setting.repetitions):
        for levels in setting.levels:
            for folder, target in targets.items():
                plan = _plan(folder, target, levels)
                plans[folder, levels].append(plan)
                print(f"  {folder.name}: {plan}", flush=True)
    few, many = setting.levels
    our_cost = _cost_of_a_job(plans[ours, few], plans[ours, many])
    bare_cost = _cost_of_a_job(plans[bare, few], plans[bare, many])
    total = _smallest(plans[ours, many])
    how = (
        f"a job of {total.jobs}, by the difference of {many} and {few} noise levels,"
        f" snakemake -n, minimum of {setting.repetitions};"
        f" all of them {total.seconds:.1f} CPU s and {total.peak_mb:.0f} MB,"
        f" bare {_smallest(plans[bare, many]).seconds:.1f} s"
        f" and {_smallest(plans[bare, many]).peak_mb:.0f} MB"
    )
    memory_ratio = our_cost.peak_mb / bare_cost.peak_mb
    return [
        Row.of_slowdown(
            "plan time", our_cost.seconds, bare_cost.seconds, TARGET, f"CPU of {how}"
        ),
        Row(
            "plan memory",
            None,
            None,
            memory_ratio,
            f"<= {TARGET}",
            memory_ratio <= TARGET,
            f"memory of {how}",
        ),
    ]


def _plan(folder: Path, target: str, levels: int) -> Plan:
    """Plan the jobs of a target with so many noise levels in a dry run."""
    further_levels = [level for level in range(1000) if level not in FIRST_LEVELS]
    noise_um = [*FIRST_LEVELS, *further_levels][:levels]
    config = folder / f"{levels}-levels.json"
    config.write_text(json.dumps(STUDY | {"noise_um": noise_um}), encoding="utf-8")
    command = [sys.executable, "-m", "snakemake", "-n", target]
    process = subprocess.Popen(
        [*command, "--configfile", str(config)],
        cwd=folder,
        env=os.environ | {"PYTHONPATH": str(folder / "src")},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    printed = process.stdout.read() if process.stdout else ""
    # The usage of this process alone; that of all ended processes has the largest peak.
    _, status, usage = os.wait4(process.pid, 0)
    total = re.search(r"^total +(\d+)$", printed, re.MULTILINE)
    if status or total is None:
        sys.exit(f"{printed}\nfailed: {' '.join(command)} in {folder}")
    seconds = usage.ru_utime + usage.ru_stime
    return Plan(int(total[1]), seconds, usage.ru_maxrss * 1024 / 1e6)


def _smallest(plans: Sequence[Plan]) -> Plan:
    """Return the smallest seconds and the smallest peak of the same plan."""
    seconds = min(plan.seconds for plan in plans)
    return Plan(plans[0].jobs, seconds, min(plan.peak_mb for plan in plans))


def _cost_of_a_job(few: Sequence[Plan], many: Sequence[Plan]) -> Plan:
    """Return what each further job costs."""
    small = _smallest(few)
    large = _smallest(many)
    jobs = large.jobs - small.jobs
    return Plan(
        1,
        (large.seconds - small.seconds) / jobs,
        (large.peak_mb - small.peak_mb) / jobs,
    )
