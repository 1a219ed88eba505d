"""Targets of the blind proof as a page in Markdown, for docs/."""

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
    of_each: Mapping[str, pd.DataFrame],
    size: str,
    seed: int,
) -> str:
    """Every quantity of a summary beside its target; `of_each`: of
    `summary.summarize_by_robot`, by what the robots are called."""
    return f"""# Targets of the blind proof

Written by `snakemake -j2 blind_pictures --config blind={size} seed={seed}`; [what it means](blind_proof.md). "At 50" is at a
non-centrality of 50. Brackets hold 95 % intervals: of shares Clopper–Pearson, of the others a bootstrap over cases.

{describe_reached_targets(summary)}

{format_table(tabulate_targets(plan, summary, of_each))}
"""


def describe_reached_targets(summary: pd.DataFrame) -> str:
    """How many targets are reached."""
    judged = select_targets(summary).dropna(subset="holds")
    held = int((judged.holds.astype(str) == "True").sum())
    proven = summary.robots.iloc[0] == PROOF
    where = (
        "the robots of the proof"
        if proven
        else "robots on which the method was developed, which proves nothing"
    )
    return f"{held} of {format_count(len(judged), 'figure')} with a target reach it on {where}."


def tabulate_targets(
    plan: Plan, summary: pd.DataFrame, of_each: Mapping[str, pd.DataFrame]
) -> list[dict[str, str]]:
    """Each quantity with a target as a row of words, beside what every robot has alone
    and what the best analyst finds."""
    of_all = {row.quantity: row for row in iterate_rows(summary)}
    alone = {
        name: {row.quantity: row for row in iterate_rows(one)}
        for name, one in of_each.items()
    }
    beside = {
        figure["words"]: figure["beside"]
        for figure in plan["figures"]
        if "beside" in figure
    }
    rows = []
    for row in iterate_rows(select_targets(summary)):
        compared = row.quantity.removesuffix(OVER_THE_BEST)
        found = of_all.get(beside.get(compared), row)
        limit = of_all.get(f"{compared}{BY_THE_BEST}")
        cells = {
            "quantity": found.quantity,
            "target": row.target,
            "outcome": _OUTCOMES.get(str(row.holds), "no case"),
        }
        cells |= {"robots together": _with_interval(found), "cases": _hits(found)}
        cells |= {
            name: _value(each[found.quantity]) if found.quantity in each else _ABSENT
            for name, each in alone.items()
        }
        if limit:
            cells["limit, on a sample"] = f"{_with_interval(limit)}, {_hits(limit)}"
            cells["found over limit, same sample"] = _with_interval(row)
        rows.append(cells)
    return rows


def _with_interval(row: Any) -> str:
    if pd.isna(row.low):
        return f"{_value(row)} ({_ABSENT})"
    if _is_ratio(row):
        return (
            f"{_value(row)} ({format_number(row.low, 4)}–{format_number(row.high, 4)})"
        )
    return f"{_value(row)} ({100 * row.low:.1f}–{100 * row.high:.1f} %)"


def _value(row: Any) -> str:
    if pd.isna(row.rate):
        return _ABSENT
    return format_number(row.rate, 4) if _is_ratio(row) else f"{100 * row.rate:.1f} %"


def _is_ratio(row: Any) -> bool:
    return str(row.quantity).startswith("held-out RMS after, over")


def _hits(row: Any) -> str:
    return (
        format_integer(int(row.cases))
        if pd.isna(row.hits)
        else f"{format_integer(int(row.hits))} of {format_integer(int(row.cases))}"
    )


def write_blind_page(job: Any) -> None:
    """The page, from reports/blind/."""
    asked, (summary, cases) = (
        job.params,
        (pd.read_csv(job.input[name]) for name in ("summary", "cases")),
    )
    names = {Path(file).stem: read_document(file)["name"] for file in job.input.robots}
    alone = {
        names[robot]: table
        for robot, table in summarize_by_robot(asked.plan, cases, asked.seed).items()
    }
    write_text(
        job.output.page,
        format_targets_page(asked.plan, summary, alone, asked.size, asked.seed),
    )
