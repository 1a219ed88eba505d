"""Write the targets of the blind benchmark as a page in Markdown, for docs/."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pandas as pd

from elastocal.counting import format_count, format_integer
from elastocal.io.atomic_writes import write_text
from elastocal.io.documents import read_document
from elastocal.report.words import format_number
from elastocal_proof.blind.cases import PROOF, Plan
from elastocal_proof.blind.locations import tabulate_confusion
from elastocal_proof.blind.summary import (
    BY_THE_BEST,
    OVER_THE_BEST,
    iterate_rows,
    select_targets,
    summarize_by_robot,
)
from elastocal_proof.league.table import format_table

_ABSENT = "–"
_OUTCOMES = {"True": "reached", "False": "missed"}


def format_targets_page(
    plan: Plan,
    summary: pd.DataFrame,
    summaries_by_robot: Mapping[str, pd.DataFrame],
    locations: pd.DataFrame,
    size: str,
    seed: int,
) -> str:
    """Format the page that compares every quantity of a summary with its target.

    Parameters
    ----------
    plan
        Plan of the blind benchmark.
    summary
        Summary of all robots together.
    summaries_by_robot
        Tables of `summary.summarize_by_robot` by the names of the robots.
    locations
        Rows of `locations.list_locations`.
    size, seed
        Configuration of the run.
    """
    rows = tabulate_targets(plan, summary, summaries_by_robot)
    return f"""# Targets of the blind proof

Written by `snakemake -j2 blind_pictures --config blind={size} seed={seed}`; \
[what it means](blind_proof.md). "At 50" is at a
non-centrality of 50. Brackets hold 95 % intervals: of shares Clopper–Pearson, \
of the others a bootstrap over cases.

{describe_reached_targets(summary)}

{format_table(rows)}

## Where

Effects that act at one joint, or link, by its number and by the number that the \
verdict states beside the right name.

{_format_confusion(locations)}
"""


def _format_confusion(locations: pd.DataFrame) -> str:
    confusion = tabulate_confusion(locations)
    columns = list(map(str, confusion.columns))
    cells = confusion.itertuples(index=False)
    return format_table([dict(zip(columns, row, strict=True)) for row in cells])


def describe_reached_targets(summary: pd.DataFrame) -> str:
    """Say how many targets are reached, and on which robots."""
    judged = select_targets(summary).dropna(subset="holds")
    reached = int((judged.holds.astype(str) == "True").sum())
    robots = "robots on which the method was developed, which proves nothing"
    if summary.robots.iloc[0] == PROOF:
        robots = "the robots of the proof"
    figures = format_count(len(judged), "figure")
    return f"{reached} of {figures} with a target reach it on {robots}."


def tabulate_targets(
    plan: Plan, summary: pd.DataFrame, summaries_by_robot: Mapping[str, pd.DataFrame]
) -> list[dict[str, str]]:
    """Tabulate each quantity with a target, for all robots together and for each one,
    and for the best possible analyst.

    Parameters are those of `format_targets_page`.
    """
    overall = _index_by_quantity(summary)
    by_robot = {
        name: _index_by_quantity(table) for name, table in summaries_by_robot.items()
    }
    # The analyst of the limit sees a sample. These quantities of the sample are shown with
    # the same quantity of all cases.
    quantity_of_all = {
        figure["words"]: figure["beside"]
        for figure in plan["figures"]
        if "beside" in figure
    }
    rows = []
    for target in iterate_rows(select_targets(summary)):
        quantity = target.quantity.removesuffix(OVER_THE_BEST)
        shown: Any = overall.get(quantity_of_all.get(quantity, ""), target)
        limit = overall.get(f"{quantity}{BY_THE_BEST}")
        cells = {
            "quantity": shown.quantity,
            "target": target.target,
            "outcome": _OUTCOMES.get(str(target.holds), "no case"),
            "robots together": _format_interval(shown),
            "cases": _format_hits(shown),
        }
        for name, quantities in by_robot.items():
            cells[name] = _ABSENT
            if shown.quantity in quantities:
                cells[name] = _format_rate(quantities[shown.quantity])
        if limit:
            cells["limit, on a sample"] = (
                f"{_format_interval(limit)}, {_format_hits(limit)}"
            )
            cells["found over limit, same sample"] = _format_interval(target)
        rows.append(cells)
    return rows


def _index_by_quantity(summary: pd.DataFrame) -> dict[str, Any]:
    return {row.quantity: row for row in iterate_rows(summary)}


def _format_interval(row: Any) -> str:
    if pd.isna(row.low):
        interval = _ABSENT
    elif _is_ratio(row):
        interval = f"{format_number(row.low, 4)}–{format_number(row.high, 4)}"
    else:
        interval = f"{100 * row.low:.1f}–{100 * row.high:.1f} %"
    return f"{_format_rate(row)} ({interval})"


def _format_rate(row: Any) -> str:
    if pd.isna(row.rate):
        return _ABSENT
    return format_number(row.rate, 4) if _is_ratio(row) else f"{100 * row.rate:.1f} %"


def _is_ratio(row: Any) -> bool:
    return str(row.quantity).startswith("held-out RMS after, over")


def _format_hits(row: Any) -> str:
    cases = format_integer(int(row.cases))
    return cases if pd.isna(row.hits) else f"{format_integer(int(row.hits))} of {cases}"


def write_blind_page(job: Any) -> None:
    """Write the page from reports/blind/."""
    params = job.params
    summary = pd.read_csv(job.input.summary)
    cases = pd.read_csv(job.input.cases)
    names = {Path(file).stem: read_document(file)["name"] for file in job.input.robots}
    tables = summarize_by_robot(params.plan, cases, params.seed)
    by_robot = {names[robot]: table for robot, table in tables.items()}
    locations = pd.read_csv(job.input.locations)
    page = format_targets_page(
        params.plan, summary, by_robot, locations, params.size, params.seed
    )
    write_text(job.output.page, page)
