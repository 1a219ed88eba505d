"""The clean study by Snakemake against the same jobs one after the other in one
process, CPU against CPU."""

import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

from common import ROOT, Row, interleaved
from copies import copy_study, reduce_to_records, snakemake

# Of the work: a process a job costs its start, its imports and its records.
TARGET = 2.5


@dataclass(frozen=True)
class Setting:
    """What Snakemake is asked for, and how often `rerun` asks again."""

    jobs: tuple[str, ...]
    repetitions: int


FULL = Setting(("-j2", "study"), 7)
# From seeds to a table, in three jobs.
SMALL = Setting(
    (
        "-j2",
        "reports/tables/table1.csv",
        "data/simulated/kuka/ideal.parquet",
        "--config",
        "data_sets=10",
    ),
    1,
)
# Of results/: what Snakemake and `job.run`, which no reduced script calls, note on a
# job.
NOTES = ("logs", "timings", "records")
# Every recorded job in the order in which they ended, in this one process.
ONE_PROCESS = """
import pickle, sys
from pathlib import Path

sys.path[:0] = ["src", "workflow/scripts"]
for record in sorted(Path("jobs").iterdir()):
    snakemake = pickle.loads(record.read_bytes())
    source = Path("workflow", "scripts", record.name.partition("-")[2])
    code = compile(source.read_text(encoding="utf-8"), source, "exec")
    exec(code, {"snakemake": snakemake, "__name__": "__main__"})
"""


def rows(work: Path, setting: Setting) -> list[Row]:
    """Row of the report.

    `work`: temporary folder; the finished study stays there.
    """
    recorded = copy_study(work / "recorded")
    reduce_to_records(recorded)
    snakemake(recorded, *setting.jobs)
    functions = {
        "study": lambda: finished_study(work, setting),
        "one process": lambda: _in_one_process(recorded),
    }
    (ours,), (alone,) = interleaved(functions, 1)
    if missing := _made(work / "study") ^ _made(recorded):
        raise AssertionError(
            f"one of the two did not make {', '.join(sorted(missing))}"
        )
    how = (
        f"snakemake {' '.join(setting.jobs)} on a clean copy against the same scripts"
        " one after the other in one process, CPU"
    )
    return [Row.of_slowdown("study", ours, alone, TARGET, how)]


def finished_study(work: Path, setting: Setting) -> Path:
    """Make the whole study, clean, in the folder ``study`` of `work`."""
    folder = copy_study(work / "study")
    snakemake(folder, *setting.jobs)
    return folder


def _in_one_process(recorded: Path) -> None:
    """Do all jobs that a copy has recorded, with the scripts of the repository."""
    shutil.copytree(
        ROOT / "workflow" / "scripts",
        recorded / "workflow" / "scripts",
        dirs_exist_ok=True,
    )
    subprocess.run(
        [sys.executable, "-c", ONE_PROCESS],
        cwd=recorded,
        check=True,
        stderr=subprocess.DEVNULL,
    )


def _made(folder: Path) -> set[str]:
    """Files that jobs made, without what is noted on each job beside them."""
    files = (
        path.relative_to(folder)
        for top in ("data", "results", "reports")
        for path in (folder / top).rglob("*.*")
    )
    return {
        path.as_posix()
        for path in files
        if path.parts[1] not in NOTES and (folder / path).is_file()
    }
