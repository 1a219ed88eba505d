"""Write the targets of the blind benchmark as a page in Markdown, for docs/."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pandas as pd

from elastocal.counting import format_count, format_integer
from elastocal.diagnosis.verdict import ADEQUATE, NOT_TESTABLE, UNEXPLAINED
from elastocal.io.atomic_writes import write_text
from elastocal.io.documents import read_document
from elastocal.report.words import format_number
from elastocal_proof.blind.cases import PROOF, Plan
from elastocal_proof.blind.locations import tabulate_confusion
from elastocal_proof.blind.power import tabulate_registered_targets
from elastocal_proof.blind.scores import NONE
from elastocal_proof.blind.summary import (
    iterate_rows,
    select_targets,
    summarize_by_robot,
)
from elastocal_proof.league.table import format_table

_ABSENT = "–"
_OUTCOMES = {"True": "reached", "False": "missed"}
_PROBABILITIES = {"acceptable": "power", "unacceptable": "risk"}
_SHARES = {1: "all cases", 0.5: "half of them"}
# Statements of verdicts without a mechanism.
_SILENT = (NONE, ADEQUATE, NOT_TESTABLE, UNEXPLAINED)


def format_targets_page(
    summary: pd.DataFrame,
    summaries_by_robot: Mapping[str, pd.DataFrame],
    confusion: Mapping[str, pd.DataFrame],
    size: str,
    seed: int,
) -> str:
    """Format the page that compares every quantity of a summary with its target.

    Parameters
    ----------
    summary
        Summary of all robots together.
    summaries_by_robot
        Tables of `summary.summarize_by_robot` by the names of the robots.
    confusion
        ``mechanisms``, of `summary.tabulate_mechanisms`, and ``locations``, rows of
        `locations.list_locations`.
    size, seed
        Configuration of the run.
    """
    rows = tabulate_targets(summary, summaries_by_robot)
    return f"""# Targets of the blind benchmark

Written by `snakemake -j2 blind_pictures --config blind={size} seed={seed}`; \
[what it means](blind_benchmark.md). "At 50" is at a
non-centrality of 50. Brackets hold 95 % intervals: of shares Clopper–Pearson with \
the effective number of cases (cases of one effect and intervals of one campaign are \
clusters), of other quantities a bootstrap over cases. Power is the probability to reach \
the target at its acceptable rate, risk that at its unacceptable rate.

{describe_reached_targets(summary)}

{format_table(rows)}

## Quantities without a target

{format_table(tabulate_other_quantities(summary))}

## Mechanisms

True mechanism and what the verdict states, for one mechanism at its largest size. \
"Other statements" lists the mechanisms that are stated in place of the true one.

{_format_mechanisms(confusion["mechanisms"])}

## Joints

Effects that act at one joint, or link, by its number and by the number that the \
verdict states beside the right name.

{_format_locations(confusion["locations"])}
"""


def format_registration(plan: Plan, size: str, seed: int) -> str:
    """Format the table of the targets of a benchmark that is not made yet, with the
    power and the risk of all cases and of half of them."""
    table = tabulate_registered_targets(plan, size, seed)
    rows = []
    for row in table.to_dict("records"):
        cells = {"quantity": row["quantity"], "target": row["target"]}
        cells["cases"] = _ABSENT if pd.isna(row["cases"]) else f"{int(row['cases'])}"
        for name, probability in _PROBABILITIES.items():
            cells[f"{name} rate"] = _format_percentage(row[name], 1)
            for share, words in _SHARES.items():
                value = _format_percentage(row[f"{name}_at_{share:g}"], 0)
                cells[f"{probability}, {words}"] = value
        rows.append(cells)
    return format_table(rows)


def _format_percentage(share: float, digits: int) -> str:
    return _ABSENT if pd.isna(share) else f"{100 * share:.{digits}f} %"


def tabulate_other_quantities(summary: pd.DataFrame) -> list[dict[str, str]]:
    """Tabulate the quantities that have no target."""
    targets = select_targets(summary).quantity
    others = summary[~summary.quantity.isin(targets)]
    return [
        {
            "quantity": row.quantity,
            "robots together": _format_interval(row),
            "cases": _format_hits(row),
        }
        for row in iterate_rows(others)
    ]


def _format_mechanisms(mechanisms: pd.DataFrame) -> str:
    """Format the confusion table of mechanisms, a row for each true one."""
    rows = []
    for truth, stated in mechanisms.groupby("truth"):
        largest = stated[stated.level == stated.level.max()]
        is_right = largest.stated == truth
        is_silent = largest.stated.isin(_SILENT)
        wrong = largest[~is_right & ~is_silent].groupby("stated").cases.sum()
        statements = wrong.sort_values(ascending=False, kind="stable").items()
        rows.append(
            {
                "true mechanism": str(truth).replace("_", " "),
                "cases": str(largest.cases.sum()),
                "right, alone": str(largest[is_right & largest.alone].cases.sum()),
                "right, with alternatives": str(
                    largest[is_right & ~largest.alone].cases.sum()
                ),
                "nothing stated": str(largest[is_silent].cases.sum()),
                "other statements": ", ".join(
                    f"{name.replace('_', ' ')} {count}" for name, count in statements
                ),
            }
        )
    return format_table(rows)


def _format_locations(locations: pd.DataFrame) -> str:
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
        robots = "robots on which nothing was developed"
    figures = format_count(len(judged), "figure")
    return f"{reached} of {figures} with a target reach it on {robots}."


def tabulate_targets(
    summary: pd.DataFrame, summaries_by_robot: Mapping[str, pd.DataFrame]
) -> list[dict[str, str]]:
    """Tabulate each quantity with a target, for all robots together and for each one.

    Parameters are those of `format_targets_page`.
    """
    by_robot = {
        name: _index_by_quantity(table) for name, table in summaries_by_robot.items()
    }
    rows = []
    for target in iterate_rows(select_targets(summary)):
        cells = {
            "quantity": target.quantity,
            "target": target.target,
            "outcome": _OUTCOMES.get(str(target.holds), "no case"),
            "robots together": _format_interval(target),
            "cases": _format_hits(target),
            "power, risk": _format_power(target),
        }
        for name, quantities in by_robot.items():
            cells[name] = _ABSENT
            if target.quantity in quantities:
                cells[name] = _format_rate(quantities[target.quantity])
        rows.append(cells)
    return rows


def _format_power(row: Any) -> str:
    if pd.isna(row.power):
        return _ABSENT
    power = _format_percentage(row.power, 0)
    return f"{power}, {_format_percentage(row.risk, 0)}"


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
    cases = pd.read_parquet(job.input.cases)
    names = {Path(file).stem: read_document(file)["name"] for file in job.input.robots}
    tables = summarize_by_robot(params.plan, cases, params.seed)
    by_robot = {names[robot]: table for robot, table in tables.items()}
    confusion = {
        "mechanisms": pd.read_csv(job.input.mechanisms),
        "locations": pd.read_parquet(job.input.locations),
    }
    page = format_targets_page(summary, by_robot, confusion, params.size, params.seed)
    write_text(job.output.page, page)
