"""All benchmarks, or those named: `python benchmarks/run.py [--small] [--only NAME
...]` writes reports/benchmarks.csv."""

import argparse
import csv
import importlib
import os
import sys
import tempfile
from collections.abc import Collection, Iterable
from dataclasses import fields, replace
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    # With it comes numpy, whose threads are to be set first.
    from common import Row

NAMES = (
    "kinematics",
    "identification",
    "study",
    "rerun",
    "plan",
    "scale",
    "engine",
)
REPORT = Path(__file__).resolve().parents[1] / "reports" / "benchmarks.csv"


def main() -> None:
    """Run the benchmarks; the exit status says whether every target holds."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--only",
        nargs="+",
        choices=NAMES,
        default=NAMES,
        metavar="NAME",
        help=", ".join(NAMES),
    )
    parser.add_argument(
        "--small",
        action="store_true",
        help="seconds instead of minutes: that all run, no target, no report",
    )
    given = parser.parse_args()
    names = [name for name in NAMES if name in given.only]
    # Before numpy is imported, so that it too takes one thread.
    for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ[variable] = "1"
    with tempfile.TemporaryDirectory(prefix="elastocal-benchmarks-") as work:
        report = Path(work) / REPORT.name if given.small else REPORT
        table = {line["benchmark"]: line for line in _kept(names, report)}
        for name in names:
            print(name, flush=True)
            module = importlib.import_module(name)
            for row in module.rows(
                Path(work), module.SMALL if given.small else module.FULL
            ):
                line = _line(
                    replace(row, target="", holds=None) if given.small else row
                )
                table[row.benchmark] = line
                target = line["target"] or "none"
                print(
                    f"  {row.benchmark}: ratio {line['ratio']},"
                    f" target {target} {line['holds']}",
                    flush=True,
                )
            _write(table.values(), report)
    sys.exit(any(line["holds"] == "no" for line in table.values()))


def _line(row: "Row") -> dict[str, str]:
    """Row as text: four digits, empty for none, yes or no."""
    line = {}
    for field in fields(row):
        value = getattr(row, field.name)
        if isinstance(value, float):
            value = f"{value:.4g}"
        line[field.name] = (
            "" if value is None else {True: "yes", False: "no"}.get(value, value)
        )
    return line


def _kept(names: Collection[str], report: Path) -> list[dict[str, str]]:
    """Lines of an earlier report, of the benchmarks that do not run now."""
    if not report.is_file():
        return []
    with open(report, encoding="utf-8", newline="") as file:
        return [
            line
            for line in csv.DictReader(file)
            if line["benchmark"].split()[0] not in names
        ]


def _write(lines: Iterable[dict[str, str]], report: Path) -> None:
    ordered = sorted(lines, key=lambda line: NAMES.index(line["benchmark"].split()[0]))
    report.parent.mkdir(exist_ok=True)
    with open(report, "w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, list(ordered[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(ordered)


if __name__ == "__main__":
    main()
