"""Compare seconds and peak memory of 10,000 data sets with those of 1,000.

Each step is measured for one robot, strategy and noise level.
"""

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from common import Row
from copies import copy_study, snakemake

CELL = "kuka/200um"
TIMED = "kuka/200"
STRATEGY = "3+6DoF-comb"
# The file that a job makes, and the file of its seconds, by step.
STEPS = {
    "draw_experiments": ("data/simulated/kuka/experiments.parquet", "kuka"),
    "simulate": ("data/simulated/kuka/ideal.parquet", "kuka"),
    "measure": (f"data/simulated/{CELL}/measured.parquet", TIMED),
    "identify": (
        f"results/identified/{CELL}/{STRATEGY}.parquet",
        f"{TIMED}/{STRATEGY}",
    ),
    "draw_weights": ("results/weights/kuka.parquet", "kuka"),
}
TIME_TARGET = 11
MEMORY_TARGET = 1.15
MEMORY_LIMIT_GB = 1.5
# Snakemake samples memory twice a second and misses peaks, so each job writes its own peak
# when it ends (Linux).
NOTE_PEAK = """

def run(step, job, run=run, **options):
    run(step, job, **options)
    status = dict(line.split(":", 1) for line in open("/proc/self/status", encoding="utf-8"))
    with open(job.output[0] + ".peak_kB", "w", encoding="utf-8") as file:
        file.write(status["VmHWM"].split()[0])
"""


@dataclass(frozen=True)
class Setting:
    """Two numbers of data sets, and the number of repetitions."""

    data_sets: tuple[int, int]
    repetitions: int


@dataclass(frozen=True)
class Usage:
    """Seconds and peak memory of one job."""

    seconds: float
    peak_gb: float


# The small setting runs once for both sizes.
FULL = Setting((1000, 10_000), 2)
SMALL = Setting((10, 10), 1)


def rows(work: Path, setting: Setting) -> list[Row]:
    """Measure the rows for time and for memory in a temporary folder."""
    sizes = setting.data_sets
    repetitions = setting.repetitions
    folders = {
        size: _copy_that_notes_peaks(work / f"scale-{size}")
        for size in dict.fromkeys(sizes)
    }
    runs: dict[int, list[dict[str, Usage]]] = {size: [] for size in sizes}
    for repetition in range(1, repetitions + 1):
        for size, folder in folders.items():
            snakemake(
                folder,
                "-j1",
                *(made for made, _ in STEPS.values()),
                "--config",
                f"data_sets={size}",
                "--forceall",
            )
            usage = {step: _read_usage(folder, step) for step in STEPS}
            runs[size].append(usage)
            seconds = sum(step_usage.seconds for step_usage in usage.values())
            print(
                f"  {repetition}/{repetitions}: {size} data sets {seconds:.1f} s",
                flush=True,
            )
    small, large = (_smallest_usage(runs[size]) for size in sizes)
    for step in STEPS:
        print(
            f"  {step}: {small[step].seconds:.1f} to {large[step].seconds:.1f} s,"
            f" {small[step].peak_gb:.3f} to {large[step].peak_gb:.3f} GB",
            flush=True,
        )
    compared = (
        f"{sizes[1]} against {sizes[0]} data sets,"
        f" {STRATEGY} on kuka at 200 µm, minimum of {repetitions}"
    )
    return [_time_row(small, large, compared), _memory_row(small, large, compared)]


def _time_row(small: dict[str, Usage], large: dict[str, Usage], compared: str) -> Row:
    ours = sum(usage.seconds for usage in large.values())
    theirs = sum(usage.seconds for usage in small.values())
    how = f"sum of the seconds of {', '.join(STEPS)}: {compared}"
    return Row.of_slowdown("scale time", ours, theirs, TIME_TARGET, how)


def _memory_row(small: dict[str, Usage], large: dict[str, Usage], compared: str) -> Row:
    growth = {step: large[step].peak_gb / small[step].peak_gb for step in STEPS}
    worst = max(growth, key=growth.__getitem__)
    peak_gb = max(usage.peak_gb for usage in large.values())
    return Row(
        "scale memory",
        None,
        None,
        growth[worst],
        f"<= {MEMORY_TARGET}, below {MEMORY_LIMIT_GB} GB",
        growth[worst] <= MEMORY_TARGET and peak_gb < MEMORY_LIMIT_GB,
        f"peak memory of the job that grows most, {worst};"
        f" largest of any job {peak_gb:.2f} GB: {compared}",
    )


def _copy_that_notes_peaks(folder: Path) -> Path:
    copy_study(folder)
    with open(folder / "workflow" / "scripts" / "job.py", "a", encoding="utf-8") as job:
        job.write(NOTE_PEAK)
    return folder


def _read_usage(folder: Path, step: str) -> Usage:
    made, timing = STEPS[step]
    timings = folder / "results" / "timings" / step / f"{timing}.tsv"
    with open(timings, encoding="utf-8") as file:
        seconds = float(next(csv.DictReader(file, delimiter="\t"))["s"])
    peak_kb = int((folder / f"{made}.peak_kB").read_text(encoding="utf-8"))
    return Usage(seconds, peak_kb * 1024 / 1e9)


def _smallest_usage(runs: Sequence[dict[str, Usage]]) -> dict[str, Usage]:
    """Return the smallest seconds and the smallest peak of each step over all runs."""
    smallest = {}
    for step in STEPS:
        usages = [run[step] for run in runs]
        smallest[step] = Usage(
            min(usage.seconds for usage in usages),
            min(usage.peak_gb for usage in usages),
        )
    return smallest
