"""The clean study against the same jobs that only import what they import and touch their outputs."""

from pathlib import Path

from common import Row
from copies import copy_study, reduce_to_touching, snakemake

JOBS = ("-j2", "study")
TARGET = 2


def rows(work: Path) -> list[Row]:
    """Row of the report.

    Parameters
    ----------
    work : Path
        Temporary folder; the finished study stays there.
    """
    touched = copy_study(work / "touched")
    reduce_to_touching(touched)
    theirs, _ = snakemake(touched, *JOBS)
    print(f"  importing and touching: {theirs:.1f} s", flush=True)
    folder, ours = finished_study(work)
    if missing := _made(folder) ^ _made(touched):
        raise AssertionError(f"one of the two did not make {', '.join(sorted(missing))}")
    how = f"snakemake {' '.join(JOBS)} on a clean copy, against a copy whose scripts only import and touch outputs, once each"
    return [Row("study", ours, theirs, ours / theirs, f"<= {TARGET}", ours / theirs <= TARGET, how)]


def finished_study(work: Path) -> tuple[Path, float]:
    """Make the whole study, clean, in the folder ``study`` of `work`.

    Returns
    -------
    folder : Path
    seconds : float
    """
    folder = copy_study(work / "study")
    seconds, _ = snakemake(folder, *JOBS)
    print(f"  the study: {seconds:.1f} s", flush=True)
    return folder, seconds


def _made(folder: Path) -> set[str]:
    """Files that jobs made, without the logs and timings beside them."""
    files = (path.relative_to(folder) for part in ("data", "results", "reports") for path in (folder / part).rglob("*.*"))
    return {path.as_posix() for path in files if path.parts[1] not in ("logs", "timings") and (folder / path).is_file()}
