"""What a data set of the study and a case of the blind benchmark cost, and what many of
them would: the tables of docs/cluster.md.

Usage: python benchmarks/cost.py SMALL LARGE BLIND --data-sets FEW MORE, with folders of
finished runs: the study with few data sets, with more, and the quick blind benchmark.
"""

from __future__ import annotations

import argparse
import csv
from dataclasses import dataclass
from pathlib import Path

# A job shorter than this costs a scheduler more than it computes.
JOB_MINUTES = 30


@dataclass(frozen=True)
class Cost:
    """Of a finished run: CPU seconds as Snakemake measured them, bytes that it holds,
    largest memory of a job, MB."""

    cpu_s: float
    stored_mb: float
    peak_mb: float


def cost(folder: Path) -> Cost:
    """Cost of a finished run."""
    jobs = [
        row
        for path in (folder / "results/timings").rglob("*.tsv")
        for row in csv.DictReader(path.open(), delimiter="\t")
    ]
    files = [
        path
        for name in ("data", "results", "reports")
        for path in (folder / name).rglob("*")
        if path.is_file()
    ]
    return Cost(
        sum(_number(row["cpu_time"]) for row in jobs),
        sum(path.stat().st_size for path in files) / 1e6,
        max(_number(row["max_rss"]) for row in jobs),
    )


def _number(text: str) -> float:
    """Of a job that ended before it was looked at nothing is known."""
    return float(text) if text not in ("NA", "-") else 0.0


def plan(name: str, each_s: float, each_mb: float, count: float, peak_mb: float) -> str:
    """A row of the table: what many would cost."""
    hours = each_s * count / 3600
    jobs = max(1, round(hours * 60 / JOB_MINUTES))
    row = (
        name,
        f"{each_s:.2g}",
        f"{each_mb:.2g}",
        f"{count:.0e}",
        f"{hours:.0f}",
        f"{hours / 100:.1f}",
        f"{each_mb * count / 1e3:.0f}",
    )
    return "| " + " | ".join((*row, str(jobs), f"{peak_mb:.0f}")) + " |"


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    for name in ("small", "large", "blind"):
        parser.add_argument(name, type=Path)
    parser.add_argument(
        "--data-sets",
        type=int,
        nargs=2,
        required=True,
        help="of the small and of the large study",
    )
    given = parser.parse_args()
    small = cost(given.small)
    large = cost(given.large)
    blind = cost(given.blind)
    more = given.data_sets[1] - given.data_sets[0]
    cases = sum(path.is_dir() for path in given.blind.glob("data/blind/*/*"))
    head = (
        "",
        "CPU s each",
        "MB each",
        "how many",
        "core hours",
        "hours on 100 cores",
        "GB",
        f"jobs of {JOB_MINUTES} min",
        "largest job, MB",
    )
    print("| " + " | ".join(head) + " |\n|" + "---|" * len(head))
    print(
        plan(
            "data set",
            (large.cpu_s - small.cpu_s) / more,
            (large.stored_mb - small.stored_mb) / more,
            1e6,
            large.peak_mb,
        )
    )
    print(
        plan(
            "blind case",
            blind.cpu_s / cases,
            blind.stored_mb / cases,
            1e5,
            blind.peak_mb,
        )
    )
    print(
        f"\nfrom {given.data_sets[0]} and {given.data_sets[1]} data sets, {cases} cases"
    )
