"""A rerun of the finished study, with nothing to do, against `snakemake --version`."""

from pathlib import Path
from statistics import median

from common import Row, interleaved
from copies import snakemake
from study import JOBS, finished_study

REPETITIONS = 7
TARGET = 3


def rows(work: Path) -> list[Row]:
    """Row of the report.

    Parameters
    ----------
    work : Path
        Temporary folder; the study that the benchmark of that name left there serves here too.
    """
    folder = work / "study"
    if not folder.is_dir():
        finished_study(work)

    def again() -> None:
        if "Nothing to be done" not in snakemake(folder, *JOBS)[1]:
            raise AssertionError("the rerun of the finished study had something to do")

    functions = {"rerun": again, "--version": lambda: snakemake(folder, "--version")}
    ours, theirs = map(median, interleaved(functions, REPETITIONS))
    how = f"snakemake -j2 study with everything made, against snakemake --version, median of {REPETITIONS}"
    return [Row("rerun", ours, theirs, ours / theirs, f"<= {TARGET}", ours / theirs <= TARGET, how)]
