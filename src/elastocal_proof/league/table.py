"""The league as tables, with intervals, and as a page of text: errors of every method
on poses that it has not seen."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from elastocal.campaigns.campaign import group_equal_rows
from elastocal.counting import format_count
from elastocal.random_streams import open_stream
from elastocal.residual_model.selection import NORMAL_QUANTILE
from elastocal.validation.held_out import (
    PositionErrors,
    compute_error_intervals,
    summarize_errors,
)
from elastocal_proof.league.methods import BLOCKS, DIAGNOSIS, RANDOM, SESSION, Method

# A row of the league's table; and rows of the entries table by data set, split and
# method.
Row = Mapping[Any, Any]
Entries = Mapping[tuple[str, str, str], pd.DataFrame]
_REPLICATES = 1000
_POSE = ["set", "session", "pose"]
_TITLES = {
    RANDOM: "Random poses held out",
    BLOCKS: "Blocks of joint space held out",
    SESSION: "Fitted to one data set, tested on another session of the same robot",
}
_ERRORS = "RMS in mm with 95 % intervals over poses, then the maximum; the smallest RMS of each row in bold."
_COVERED = "Share of coordinates inside the 95 % intervals that a method states."
_FOUND = (
    "Mean over the folds of the random split, the least and the largest in brackets."
)
# Mechanisms that are less probable in every fold are not listed.
_LEAST_PROBABLE = 0.05


def compare_methods(
    entries: Entries, robots: Mapping[str, Sequence[str]], reference: str, seed: int
) -> pd.DataFrame:
    """One row for each data set, split and method, all of whose methods predict the
    same poses.

    `robots`: data sets by the names of their robots. RMS with 95 % limits by a
    bootstrap over poses; ``ratio``: RMS over that of the reference, ``ratio_to_best``:
    over the best of the row's data set and split; ``covered``: coordinates inside the
    95 % intervals that the method states.
    """
    robot_of = {data: robot for robot, names in robots.items() for data in names}
    rows: list[dict[str, Any]] = []
    for data, split in dict.fromkeys(key[:2] for key in entries):
        mine = {
            method: part
            for (name, way, method), part in entries.items()
            if (name, way) == (data, split)
        }
        distances = [
            np.linalg.norm(part[["dx", "dy", "dz"]].to_numpy(), axis=1)
            for part in mine.values()
        ]
        poses = [group_equal_rows(part[_POSE].to_numpy())[1] for part in mine.values()]
        errors = [PositionErrors(*each) for each in zip(distances, poses, strict=True)]
        figures = [summarize_errors(error.distance) for error in errors]
        rms = [each["rms_m"] for each in figures]
        places = {
            "ratio": list(mine).index(reference),
            "ratio_to_best": int(np.argmin(rms)),
        }
        drawn = [
            compute_error_intervals(
                errors,
                _REPLICATES,
                open_stream(seed, data, f"league {split}", number),
                place,
            )
            for number, place in enumerate(places.values())
        ]
        for number, (method, part) in enumerate(mine.items()):
            low, high = drawn[0][0][number]["rms_m"]
            row = {
                "robot": robot_of[data],
                "data": data,
                "split": split,
                "method": method,
                "poses": errors[number].poses,
            }
            metres = {
                "rms": rms[number],
                "rms_low": low,
                "rms_high": high,
                "max": figures[number]["max_m"],
            }
            row |= {f"{name}_mm": 1e3 * value for name, value in metres.items()}
            for (name, place), (_, reduction) in zip(
                places.items(), drawn, strict=True
            ):
                ends = {
                    f"{name}_low": 1.0 - reduction[number].high,
                    f"{name}_high": 1.0 - reduction[number].low,
                }
                row |= {name: rms[number] / rms[place]} | ends
            rows.append(row | {"covered": _covered(part)})
    return pd.DataFrame(rows)


def summarize_mechanisms(
    found: Mapping[str, pd.DataFrame], robots: Mapping[str, Sequence[str]], folds: int
) -> pd.DataFrame:
    """Mechanisms of each data set over the diagnoses of its folds: mean, least and
    largest probability and share.

    `found`: rows of the mechanisms table of the random split, by data set. A fold that
    does not list a mechanism counts as 0.
    """
    rows = []
    for robot, data in (
        (robot, data) for robot, names in robots.items() for data in names
    ):
        for mechanism, part in found[data].groupby("mechanism", sort=True):
            row = {"robot": robot, "data": data, "mechanism": mechanism}
            for name in ("probability", "share"):
                values = np.zeros(folds)
                values[: len(part)] = part[name]
                row |= {
                    name: values.mean(),
                    f"{name}_low": values.min(),
                    f"{name}_high": values.max(),
                }
            rows.append(row)
    return pd.DataFrame(rows)


def _covered(entries: pd.DataFrame) -> float:
    off = np.abs(entries[["dx", "dy", "dz"]].to_numpy())
    stated = entries[["std_x", "std_y", "std_z"]].to_numpy()
    return (
        float((off < NORMAL_QUANTILE * stated).mean())
        if np.isfinite(stated).all()
        else float("nan")
    )


def format_league_page(
    table: pd.DataFrame,
    mechanisms: pd.DataFrame,
    methods: Mapping[str, Method],
    missing: Mapping[str, str],
) -> str:
    """Tables of the league as Markdown; `missing`: data sets that were left out, with
    the file that each lacks."""
    words = {name: method.words or name for name, method in methods.items()}
    table = table.assign(
        best=table.groupby(["data", "split"])["rms_mm"].transform("min")
    )

    def error(each: Row) -> str:
        rms, low, high, most = (
            _shown(each[key], each["rms_mm"])
            for key in ("rms_mm", "rms_low_mm", "rms_high_mm", "max_mm")
        )
        return f"{f'**{rms}**' if each['rms_mm'] == each['best'] else rms} ({low}–{high}), {most}"

    parts = [
        f"Left out: {_words(name)}, as {file} is missing."
        for name, file in missing.items()
    ]
    parts.append(
        _lead(
            table,
            {name for name, method in methods.items() if method.physics == DIAGNOSIS},
        )
    )
    for split, title in _TITLES.items():
        mine = table[table["split"] == split]
        if len(mine):
            counts = (
                mine.loc[mine.groupby("data")["rms_mm"].idxmin(), "method"]
                .map(words)
                .value_counts()
            )
            each = ", ".join(f"{name} {count}" for name, count in counts.items())
            winners = f"Smallest RMS error of {format_count(int(counts.sum()), 'data set')}: {each}."
            parts += [
                f"## {title}",
                winners,
                format_collapsible(
                    _ERRORS, _wide(mine, ["data", "poses"], words, error)
                ),
            ]
    stated = table.dropna(subset="covered")
    # The middle of the coverages of each method, and their range.
    medians = [
        f"{words[str(name)]} {100 * part.median():.0f} % (from {100 * part.min():.0f} to {100 * part.max():.0f})"
        for name, part in stated.groupby("method", sort=False)["covered"]
    ]
    parts += [
        "## Intervals",
        f"Median over data sets and splits: {'; '.join(medians)}.",
    ]
    parts += [
        format_collapsible(
            _COVERED,
            _wide(
                stated,
                ["data", "split"],
                words,
                lambda each: f"{100 * each['covered']:.1f} %",
            ),
        )
    ]
    parts += ["## Mechanisms", format_collapsible(_FOUND, _mechanisms(mechanisms))]
    return "\n\n".join(parts) + "\n"


def format_collapsible(title: str, table: str) -> str:
    """A table that a reader opens, under a title, as the Markdown of GitHub and of
    MyST."""
    return f"<details><summary>{title}</summary>\n\n{table}\n\n</details>"


def format_table(rows: list[dict[str, Any]]) -> str:
    """A table of which each row has its cells by the heads of their columns."""
    return (
        pd.DataFrame(rows).fillna("").to_markdown(index=False, disable_numparse=True)
        if rows
        else "None."
    )


def _wide(
    table: pd.DataFrame,
    heads: list[str],
    words: Mapping[str, str],
    cell: Callable[[Row], str],
) -> str:
    """A row for each of `heads`, a column for each method."""
    rows: dict[tuple[Any, ...], dict[str, Any]] = {}
    for each in table.to_dict("records"):
        key = tuple(each[head] for head in heads)
        named = {
            head: _words(each[head]) if head == "data" else each[head] for head in heads
        }
        rows.setdefault(key, named)[words[each["method"]]] = cell(each)
    return format_table([*rows.values()])


def _lead(table: pd.DataFrame, ours: set[str]) -> str:
    """In how many rows of all tables the best method rests on a diagnosis, and in how
    many it does not."""
    ahead: dict[bool, list[bool]] = {True: [], False: []}
    for _, part in table.groupby(["split", "data"]):
        diagnosed = part["method"].isin(ours).to_numpy()
        wins = bool(diagnosed[part["rms_mm"].argmin()])
        ahead[wins].append(
            bool((part["ratio_to_best_low"][diagnosed != wins] > 1.0).all())
        )
    won = ahead[True]
    lost = ahead[False]
    return (
        f"A method that diagnoses has the smallest RMS error in {len(won)} of {len(won) + len(lost)} rows, in {sum(won)} with"
        f" 95 % confidence against each other method; another has it in {len(lost)}, in {sum(lost)} with that confidence."
    )


def _mechanisms(table: pd.DataFrame) -> str:
    shown = table[table["probability_high"] >= _LEAST_PROBABLE]
    rows = []
    for _, part in shown.groupby("data", sort=False):
        for each in part.sort_values("share", ascending=False).to_dict("records"):
            share, low, high = (
                100 * each[key] for key in ("share", "share_low", "share_high")
            )
            row = {"data": _words(each["data"]), "mechanism": _words(each["mechanism"])}
            row["probability"] = (
                f"{each['probability']:.2f} ({each['probability_low']:.2f}–{each['probability_high']:.2f})"
            )
            rows.append(
                row
                | {
                    "share of the squared error": f"{share:.0f} % ({low:.0f}–{high:.0f})"
                }
            )
    return format_table(rows)


def _words(name: str) -> str:
    return name.replace("_", " ")


def _shown(value: float, scale: float) -> str:
    """A figure in mm with the decimals that show three significant digits of another,
    at most four."""
    return f"{value:.{int(np.clip(2 - np.floor(np.log10(scale)), 0, 4)) if scale > 0 else 3}f}"
