"""10,000 data sets against 1,000: seconds and peak memory of each step for one robot,
strategy and noise level."""

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from common import Row
from copies import copy_study, snakemake

CELL = "kuka/200um"
TIMED = "kuka/200"
STRATEGY = "3+6DoF-comb"
# What a job makes, and where Snakemake notes its seconds.
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
# Snakemake samples memory twice a second and misses peaks: each job notes its own when
# it ends (Linux).
NOTE_PEAK = """

def run(step, job, *checked, run=run):
    run(step, job, *checked)
    status = dict(line.split(":", 1) for line in open("/proc/self/status", encoding="utf-8"))
    with open(job.output[0] + ".peak_kB", "w", encoding="utf-8") as file:
        file.write(status["VmHWM"].split()[0])
"""


@dataclass(frozen=True)
class Setting:
    """Numbers of data sets, and repetitions."""

    data_sets: tuple[int, int]
    repetitions: int


# The small one runs once for both sizes.
FULL = Setting((1000, 10_000), 2)
SMALL = Setting((10, 10), 1)


def rows(work: Path, setting: Setting) -> list[Row]:
    """Rows of the report, for time and for memory.

    `work`: temporary folder.
    """
    sizes = setting.data_sets
    repetitions = setting.repetitions
    folders = {
        size: _copy_that_notes_peaks(work / f"scale-{size}")
        for size in dict.fromkeys(sizes)
    }
    runs: dict[int, list[dict[str, tuple[float, float]]]] = {size: [] for size in sizes}
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
            runs[size].append({step: _seconds_and_peak(folder, step) for step in STEPS})
            print(
                f"  {repetition}/{repetitions}: {size} data sets {sum(s for s, _ in runs[size][-1].values()):.1f} s",
                flush=True,
            )
    (small_s, small_gb), (large_s, large_gb) = (_smallest(runs[size]) for size in sizes)
    for step in STEPS:
        growth = f"{small_s[step]:.1f} to {large_s[step]:.1f} s, {small_gb[step]:.3f} to {large_gb[step]:.3f} GB"
        print(f"  {step}: {growth}", flush=True)
    theirs = sum(small_s.values())
    ours = sum(large_s.values())
    worst = max(STEPS, key=lambda step: large_gb[step] / small_gb[step])
    growth = large_gb[worst] / small_gb[worst]
    peak = max(large_gb.values())
    against = f"{sizes[1]} against {sizes[0]} data sets, {STRATEGY} on kuka at 200 µm, minimum of {repetitions}"
    time = f"sum of the seconds of {', '.join(STEPS)}: {against}"
    memory = f"peak memory of the job that grows most, {worst}; largest of any job {peak:.2f} GB: {against}"
    within = growth <= MEMORY_TARGET and peak < MEMORY_LIMIT_GB
    return [
        Row(
            "scale time",
            ours,
            theirs,
            ours / theirs,
            f"<= {TIME_TARGET}",
            ours / theirs <= TIME_TARGET,
            time,
        ),
        Row(
            "scale memory",
            None,
            None,
            growth,
            f"<= {MEMORY_TARGET}, below {MEMORY_LIMIT_GB} GB",
            within,
            memory,
        ),
    ]


def _copy_that_notes_peaks(folder: Path) -> Path:
    copy_study(folder)
    with open(folder / "workflow" / "scripts" / "job.py", "a", encoding="utf-8") as job:
        job.write(NOTE_PEAK)
    return folder


def _seconds_and_peak(folder: Path, step: str) -> tuple[float, float]:
    made, timing = STEPS[step]
    with open(
        folder / "results" / "timings" / step / f"{timing}.tsv", encoding="utf-8"
    ) as file:
        seconds = float(next(csv.DictReader(file, delimiter="\t"))["s"])
    return seconds, int(
        (folder / f"{made}.peak_kB").read_text(encoding="utf-8")
    ) * 1024 / 1e9


def _smallest(
    runs: Sequence[dict[str, tuple[float, float]]],
) -> tuple[dict[str, float], ...]:
    """Seconds and GB of each step, the smallest of its runs."""
    return tuple(
        {step: min(run[step][part] for run in runs) for step in STEPS}
        for part in (0, 1)
    )
