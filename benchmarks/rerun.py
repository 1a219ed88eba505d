"""A rerun of the finished study, with nothing to do, against `snakemake --version`."""

from pathlib import Path

from common import Row, interleaved
from copies import snakemake
from study import FULL, SMALL, Setting, finished_study

__all__ = ["FULL", "SMALL", "rows"]

TARGET = 3


def rows(work: Path, setting: Setting) -> list[Row]:
    """Row of the report.

    `work`: temporary folder; the study that the benchmark of that name left there
    serves here too.
    """
    folder = work / "study"
    if not folder.is_dir():
        finished_study(work, setting)

    def again() -> None:
        if "Nothing to be done" not in snakemake(folder, *setting.jobs)[1]:
            raise AssertionError("the rerun of the finished study had something to do")

    functions = {"rerun": again, "--version": lambda: snakemake(folder, "--version")}
    ours, theirs = map(min, interleaved(functions, setting.repetitions))
    how = (
        f"snakemake {' '.join(setting.jobs)} with everything made,"
        f" against snakemake --version, minimum of {setting.repetitions}"
    )
    return [Row.of_slowdown("rerun", ours, theirs, TARGET, how)]
