"""The clean study against its empty job graph, against the same jobs that only import, and against the science alone."""

import shutil
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

from common import ROOT, Row
from copies import copy_study, reduce_to_imports, reduce_to_records, snakemake

TARGET = 1.5


@dataclass(frozen=True)
class Setting:
    """What Snakemake is asked for, and how often `rerun` asks again."""

    jobs: tuple[str, ...]
    repetitions: int


FULL = Setting(("-j2", "study"), 7)
# From seeds to a table, in three jobs.
SMALL = Setting(("-j2", "reports/tables/table1.csv", "data/simulated/kuka/ideal.parquet", "--config", "data_sets=10"), 1)
# Of results/: what Snakemake and `job.run`, which no reduced script calls, note on a job.
NOTES = ("logs", "timings", "records")
# Every recorded job in the order in which they ended, in this one process.
ONE_PROCESS = """
import pickle, sys
from pathlib import Path

sys.path[:0] = ["src", "workflow/scripts"]
for record in sorted(Path("jobs").iterdir()):
    snakemake = pickle.loads(record.read_bytes())
    source = Path("workflow", "scripts", record.name.partition("-")[2])
    exec(compile(source.read_text(encoding="utf-8"), source, "exec"), {"snakemake": snakemake, "__name__": "__main__"})
"""


def rows(work: Path, setting: Setting) -> list[Row]:
    """Rows of the report.

    `work`: temporary folder; the finished study stays there.
    """
    empty, importing = copy_study(work / "empty"), copy_study(work / "importing")
    # Of every job, in the small setting too: a source that a copy lacks shows at once.
    snakemake(importing, "-n", *FULL.jobs)
    reduce_to_records(empty)
    reduce_to_imports(importing)
    empty_s, _ = snakemake(empty, *setting.jobs)
    print(f"  the empty job graph: {empty_s:.1f} s", flush=True)
    importing_s, _ = snakemake(importing, *setting.jobs)
    print(f"  importing: {importing_s:.1f} s", flush=True)
    folder, ours = finished_study(work, setting)
    alone_s = _in_one_process(empty)
    print(f"  in one process: {alone_s:.1f} s", flush=True)
    for other in (empty, importing):
        if missing := _made(folder) ^ _made(other):
            raise AssertionError(f"one of the two did not make {', '.join(sorted(missing))}")
    how = f"snakemake {' '.join(setting.jobs)} on a clean copy, once, against "
    return [
        Row(
            "study",
            ours,
            empty_s,
            ours / empty_s,
            f"<= {TARGET:g}",
            ours / empty_s <= TARGET,
            how + "a copy whose scripts import nothing of ours and touch their outputs",
        ),
        Row("study imports", ours, importing_s, ours / importing_s, "", None, how + "a copy whose scripts import and touch"),
        Row(
            "study one process",
            ours,
            alone_s,
            ours / alone_s,
            "",
            None,
            how + "the same scripts one after the other in one process",
        ),
    ]


def finished_study(work: Path, setting: Setting) -> tuple[Path, float]:
    """Make the whole study, clean, in the folder ``study`` of `work`."""
    folder = copy_study(work / "study")
    seconds, _ = snakemake(folder, *setting.jobs)
    print(f"  the study: {seconds:.1f} s", flush=True)
    return folder, seconds


def _in_one_process(recorded: Path) -> float:
    """Seconds of all jobs that a copy has recorded, with the scripts of the repository."""
    shutil.copytree(ROOT / "workflow" / "scripts", recorded / "workflow" / "scripts", dirs_exist_ok=True)
    start = time.perf_counter()
    subprocess.run([sys.executable, "-c", ONE_PROCESS], cwd=recorded, check=True, stderr=subprocess.DEVNULL)
    return time.perf_counter() - start


def _made(folder: Path) -> set[str]:
    """Files that jobs made, without what is noted on each job beside them."""
    files = (path.relative_to(folder) for part in ("data", "results", "reports") for path in (folder / part).rglob("*.*"))
    return {path.as_posix() for path in files if path.parts[1] not in NOTES and (folder / path).is_file()}
