"""All benchmarks, or those named: `python benchmarks/run.py [--only NAME ...]` writes reports/benchmarks.csv."""

import argparse
import csv
import importlib
import os
import sys
import tempfile
from collections.abc import Collection, Iterable
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    # With it comes numpy, whose threads are to be set first.
    from common import Row

NAMES = ("kinematics", "identification", "study", "rerun", "scale", "loop", "large")
REPORT = Path(__file__).resolve().parents[1] / "reports" / "benchmarks.csv"


def main() -> None:
    """Run the benchmarks; the exit status says whether every target holds."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", nargs="+", choices=NAMES, default=NAMES, metavar="NAME", help=", ".join(NAMES))
    names = [name for name in NAMES if name in parser.parse_args().only]
    # Before numpy is imported, so that it too takes one thread.
    for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ[variable] = "1"
    table = {line["benchmark"]: line for line in _kept(names)}
    with tempfile.TemporaryDirectory(prefix="elastocal-benchmarks-") as work:
        for name in names:
            print(name, flush=True)
            for row in importlib.import_module(name).rows(Path(work)):
                line = _line(row)
                table[row.benchmark] = line
                print(f"  {row.benchmark}: ratio {line['ratio']}, target {row.target or 'none'} {line['holds']}", flush=True)
            _write(table.values())
    sys.exit(any(line["holds"] == "no" for line in table.values()))


def _line(row: "Row") -> dict[str, str]:
    """Row as text: four digits, empty for none, yes or no."""
    line = {}
    for field in fields(row):
        value = getattr(row, field.name)
        if isinstance(value, float):
            value = f"{value:.4g}"
        line[field.name] = "" if value is None else {True: "yes", False: "no"}.get(value, value)
    return line


def _kept(names: Collection[str]) -> list[dict[str, str]]:
    """Lines of an earlier report, of the benchmarks that do not run now."""
    if not REPORT.is_file():
        return []
    with open(REPORT, encoding="utf-8", newline="") as file:
        return [line for line in csv.DictReader(file) if line["benchmark"].split()[0] not in names]


def _write(lines: Iterable[dict[str, str]]) -> None:
    ordered = sorted(lines, key=lambda line: NAMES.index(line["benchmark"].split()[0]))
    REPORT.parent.mkdir(exist_ok=True)
    with open(REPORT, "w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, list(ordered[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(ordered)


if __name__ == "__main__":
    main()
