"""Tabulate the errors of all methods of the benchmark at held-out poses, with intervals,
and write them as a page of text."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from elastocal.campaigns.campaign import group_equal_rows
from elastocal.counting import format_count
from elastocal.io.data_frames import Frames
from elastocal.random_streams import open_stream
from elastocal.residual_model.selection import NORMAL_QUANTILE
from elastocal.validation.held_out import (
    PositionErrors,
    compute_error_intervals,
    summarize_errors,
)
from elastocal_proof.league.methods import BLOCKS, DIAGNOSIS, RANDOM, SESSION, Method

# A row of a table by the names of its columns.
Row = Mapping[Any, Any]
# Rows of the entries table by data set, split and method.
Entries = Mapping[tuple[str, str, str], pd.DataFrame]
# Number of bootstrap replicates of an interval.
_REPLICATES = 1000
_TITLES = {
    RANDOM: "Random poses held out",
    BLOCKS: "Blocks of joint space held out",
    SESSION: "Fitted to one data set, tested on another session of the same robot",
}
_ERRORS_TITLE = (
    "RMS in mm with 95 % intervals over poses, then the maximum; the smallest RMS of"
    " each row in bold."
)
_COVERAGE_TITLE = "Share of coordinates inside the 95 % intervals that a method states."
_MECHANISMS_TITLE = (
    "Mean over the folds of the random split, the least and the largest in brackets."
)
# A mechanism is listed if its probability exceeds this value in some fold.
_MIN_PROBABILITY = 0.05


def compare_methods(
    entries: Entries, robots: Mapping[str, Sequence[str]], reference: str, seed: int
) -> pd.DataFrame:
    """Compare the errors of all methods by data set and split.

    All methods of a data set and split predict the same poses.

    Parameters
    ----------
    entries
        Predictions of each method.
    robots
        Data sets by the names of their robots.
    reference
        Method to which the others are compared.
    seed
        Of the bootstrap.

    Returns
    -------
    One row for each data set, split and method: RMS with 95 % limits by a bootstrap over
    poses, and the maximum; ``ratio``: RMS divided by that of the reference;
    ``ratio_to_best``: divided by the smallest of the same data set and split;
    ``covered``: share of coordinates inside the 95 % intervals that the method states.
    """
    robot_of = {data: robot for robot, names in robots.items() for data in names}
    rows = []
    for data, split in dict.fromkeys(key[:2] for key in entries):
        predictions = {
            key[2]: table for key, table in entries.items() if key[:2] == (data, split)
        }
        draws = [open_stream(seed, data, f"league {split}", k) for k in range(2)]
        key = {"robot": robot_of[data], "data": data, "split": split}
        rows += [key | row for row in _compare_round(predictions, reference, draws)]
    return pd.DataFrame(rows)


def _compare_round(
    predictions: Frames,
    reference: str,
    draws: Sequence[np.random.Generator],
) -> Iterator[dict[str, Any]]:
    """Compare methods on the same poses; `draws` are for the two ratios."""
    errors = [_measure_errors(table) for table in predictions.values()]
    summaries = [summarize_errors(error.distance) for error in errors]
    rms = [summary["rms_m"] for summary in summaries]
    references = {
        "ratio": list(predictions).index(reference),
        "ratio_to_best": int(np.argmin(rms)),
    }
    bootstraps = [
        compute_error_intervals(errors, _REPLICATES, stream, index)
        for stream, index in zip(draws, references.values(), strict=True)
    ]
    for number, (method, table) in enumerate(predictions.items()):
        low_m, high_m = bootstraps[0][0][number]["rms_m"]
        row = {
            "method": method,
            "poses": errors[number].poses,
            "rms_mm": 1e3 * rms[number],
            "rms_low_mm": 1e3 * low_m,
            "rms_high_mm": 1e3 * high_m,
            "max_mm": 1e3 * summaries[number]["max_m"],
        }
        for name, (_, reductions) in zip(references, bootstraps, strict=True):
            row[name] = rms[number] / rms[references[name]]
            row[f"{name}_low"] = 1.0 - reductions[number].high
            row[f"{name}_high"] = 1.0 - reductions[number].low
        yield row | {"covered": _compute_coverage(table)}


def _measure_errors(entries: pd.DataFrame) -> PositionErrors:
    distance = np.linalg.norm(entries[["dx", "dy", "dz"]].to_numpy(), axis=1)
    poses = entries[["set", "session", "pose"]].to_numpy()
    return PositionErrors(distance, group_equal_rows(poses)[1])


def _compute_coverage(entries: pd.DataFrame) -> float:
    """Share of coordinates inside the stated intervals; NaN if none are stated."""
    std = entries[["std_x", "std_y", "std_z"]].to_numpy()
    if not np.isfinite(std).all():
        return float("nan")
    error = np.abs(entries[["dx", "dy", "dz"]].to_numpy())
    return float((error < NORMAL_QUANTILE * std).mean())


def summarize_mechanisms(
    mechanisms: Frames,
    robots: Mapping[str, Sequence[str]],
    folds: int,
) -> pd.DataFrame:
    """Summarize the mechanisms that the diagnoses of all folds found in each data set.

    Parameters
    ----------
    mechanisms
        Mechanisms table of the random split by data set.
    robots
        Data sets by the names of their robots.
    folds
        Number of folds. A fold that does not list a mechanism counts as zero.

    Returns
    -------
    Mean, smallest and largest probability and share of each mechanism.
    """
    rows = []
    robot_of = {data: robot for robot, names in robots.items() for data in names}
    for data, robot in robot_of.items():
        for mechanism, listed in mechanisms[data].groupby("mechanism", sort=True):
            row = {"robot": robot, "data": data, "mechanism": mechanism}
            for name in ("probability", "share"):
                values = np.zeros(folds)
                values[: len(listed)] = listed[name]
                row[name] = values.mean()
                row[f"{name}_low"] = values.min()
                row[f"{name}_high"] = values.max()
            rows.append(row)
    return pd.DataFrame(rows)


def format_league_page(
    table: pd.DataFrame,
    mechanisms: pd.DataFrame,
    methods: Mapping[str, Method],
    missing: Mapping[str, str],
) -> str:
    """Format the tables of the benchmark as a Markdown page.

    Parameters
    ----------
    table, mechanisms
        Tables of `compare_methods` and `summarize_mechanisms`.
    methods
        Methods by name.
    missing
        Data sets that were left out, and the file that each lacks.
    """
    labels = {name: method.words or name for name, method in methods.items()}
    diagnosing = [name for name in methods if methods[name].physics == DIAGNOSIS]
    best = table.groupby(["data", "split"])["rms_mm"].transform("min")
    table = table.assign(best=best)
    paragraphs = [
        f"Left out: {_format_name(name)}, as {file} is missing."
        for name, file in missing.items()
    ]
    paragraphs.append(_describe_lead(table, diagnosing))
    for split, title in _TITLES.items():
        compared = table[table["split"] == split]
        if compared.empty:
            continue
        best_rows = compared.groupby("data")["rms_mm"].idxmin()
        counts = compared.loc[best_rows, "method"].map(labels).value_counts()
        winners = ", ".join(f"{name} {count}" for name, count in counts.items())
        errors = _pivot_methods(compared, ["data", "poses"], labels, _format_errors)
        paragraphs += [
            f"## {title}",
            f"Smallest RMS error of {format_count(int(counts.sum()), 'data set')}:"
            f" {winners}.",
            format_collapsible(_ERRORS_TITLE, errors),
        ]
    stated = table.dropna(subset="covered")
    medians = [
        f"{labels[str(name)]} {100 * shares.median():.0f} %"
        f" (from {100 * shares.min():.0f} to {100 * shares.max():.0f})"
        for name, shares in stated.groupby("method", sort=False)["covered"]
    ]
    coverage = _pivot_methods(
        stated,
        ["data", "split"],
        labels,
        lambda row: f"{100 * row['covered']:.1f} %",
    )
    paragraphs += [
        "## Intervals",
        f"Median over data sets and splits: {'; '.join(medians)}.",
        format_collapsible(_COVERAGE_TITLE, coverage),
        "## Mechanisms",
        format_collapsible(_MECHANISMS_TITLE, _format_mechanisms(mechanisms)),
    ]
    return "\n\n".join(paragraphs) + "\n"


def format_collapsible(title: str, table: str) -> str:
    """Format a table that the reader unfolds, for the Markdown of GitHub and MyST."""
    return f"<details><summary>{title}</summary>\n\n{table}\n\n</details>"


def format_table(rows: list[dict[str, Any]]) -> str:
    """Format rows, by the heads of their columns, as a Markdown table."""
    if not rows:
        return "None."
    cells = pd.DataFrame(rows).fillna("")
    return cells.to_markdown(index=False, disable_numparse=True)


def _pivot_methods(
    table: pd.DataFrame,
    heads: list[str],
    labels: Mapping[str, str],
    format_cell: Callable[[Row], str],
) -> str:
    """Format a table with a row for each value of `heads` and a column for each
    method."""
    rows: dict[tuple[Any, ...], dict[str, Any]] = {}
    for record in table.to_dict("records"):
        key = tuple(record[head] for head in heads)
        if key not in rows:
            data = _format_name(record["data"])
            rows[key] = dict(zip(heads, key, strict=True)) | {"data": data}
        rows[key][labels[record["method"]]] = format_cell(record)
    return format_table([*rows.values()])


def _describe_lead(table: pd.DataFrame, diagnosing: list[str]) -> str:
    """Count the rows of all tables whose best method uses a diagnosis, and the others;
    and those in which it beats all methods of the other kind with confidence."""
    # Whether the lead is certain, in each row that a method of this kind wins.
    lead_is_certain: dict[bool, list[bool]] = {True: [], False: []}
    for _, compared in table.groupby(["split", "data"]):
        diagnosed = compared["method"].isin(diagnosing).to_numpy()
        wins = bool(diagnosed[compared["rms_mm"].argmin()])
        alternative_ratios = compared["ratio_to_best_low"][diagnosed != wins]
        lead_is_certain[wins].append(bool((alternative_ratios > 1.0).all()))
    won = lead_is_certain[True]
    lost = lead_is_certain[False]
    return (
        f"A method that diagnoses has the smallest RMS error in {len(won)} of"
        f" {len(won) + len(lost)} rows, in {sum(won)} with 95 % confidence against each"
        f" other method; another has it in {len(lost)}, in {sum(lost)} with that"
        " confidence."
    )


def _format_mechanisms(table: pd.DataFrame) -> str:
    rows = []
    probable = table[table["probability_high"] >= _MIN_PROBABILITY]
    for _, listed in probable.groupby("data", sort=False):
        for record in listed.sort_values("share", ascending=False).to_dict("records"):
            rows.append(
                {
                    "data": _format_name(record["data"]),
                    "mechanism": _format_name(record["mechanism"]),
                    "probability": f"{record['probability']:.2f}"
                    f" ({record['probability_low']:.2f}–{record['probability_high']:.2f})",
                    "share of the squared error": f"{100 * record['share']:.0f} %"
                    f" ({100 * record['share_low']:.0f}–{100 * record['share_high']:.0f})",
                }
            )
    return format_table(rows)


def _format_name(name: str) -> str:
    return name.replace("_", " ")


def _format_errors(row: Row) -> str:
    """RMS with its interval and the maximum in mm; the best RMS is bold.

    The decimals, four at most, show three significant digits of the RMS.
    """
    scale = row["rms_mm"]
    decimals = 3
    if scale > 0:
        decimals = int(np.clip(2 - np.floor(np.log10(scale)), 0, 4))
    rms, low, high, largest = (
        f"{row[key]:.{decimals}f}"
        for key in ("rms_mm", "rms_low_mm", "rms_high_mm", "max_mm")
    )
    bold = "**" if scale == row["best"] else ""
    return f"{bold}{rms}{bold} ({low}–{high}), {largest}"
