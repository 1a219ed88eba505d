"""Targets of the workflow beside study and loop: an audit takes in what of them has finished and makes none of them run."""

from __future__ import annotations

from typing import TYPE_CHECKING

from elastocal.io.records import read_record, record_of

if TYPE_CHECKING:
    from pathlib import Path

# What each makes last.
OTHERS = {
    "measured": "reports/loop/measured.csv",
    "league": "reports/league/all/league.csv",
    "league_small": "reports/league/small/league.csv",
    "blind": "reports/blind/summary.csv",
    "closed_loop": "reports/closed_loop/goals.csv",
    "bad_rows": "reports/bad_rows/summary.csv",
    "planning": "reports/planning/gains.csv",
    "extended_study": "reports/tables/interpretations.csv",
}


def finished(folder: Path) -> dict[str, str]:
    """What jobs recorded of those that have finished.

    `folder`: of the run. Returns checksum of the last file by target.
    """
    there = {target: file for target, file in OTHERS.items() if record_of(file, folder).is_file() and (folder / file).is_file()}
    return {target: read_record(file, folder)[1][file] for target, file in there.items()}
