"""The league as a page of text: every table in full."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from elastocal.counting import counted
from elastocal_proof.league.folds import BLOCKS, RANDOM, SESSION
from elastocal_proof.league.methods import DIAGNOSIS

if TYPE_CHECKING:
    from collections.abc import Mapping
    from typing import Any

    from elastocal_proof.league.methods import Method

_TITLES = {
    RANDOM: "Random poses held out",
    BLOCKS: "Blocks of joint space held out",
    SESSION: "Fitted to one data set, tested on another session of the same robot",
}
_ERRORS = "RMS in mm with 95 % intervals over poses, then the maximum; the smallest RMS of each row in bold."
_COVERED = "Share of coordinates inside the 95 % intervals that a method states."
_FOUND = "Mean over the folds of the random split, the least and the largest in brackets."
_SPENT = "Seconds of a core for each fold of the random split, tuning included, and the most memory."
# Mechanisms that are less probable in every fold are not listed.
_LEAST_PROBABLE = 0.05


def league_page(
    table: pd.DataFrame,
    costs: pd.DataFrame,
    mechanisms: pd.DataFrame,
    published: pd.DataFrame,
    methods: Mapping[str, Method],
    missing: Mapping[str, str],
) -> str:
    """Tables of the league as Markdown.

    `published`: Figures of other people: ``data, rms_mm, what, source, why``. `missing`: data sets that were left out, with the
    file that each lacks.
    """
    words = {name: method.words or name for name, method in methods.items()}
    parts = [f"Left out: {_words(name)}, as {file} is missing." for name, file in missing.items()]
    parts.append(_lead(table, {name for name, method in methods.items() if method.physics == DIAGNOSIS}))
    for split, title in _TITLES.items():
        mine = table[table["split"] == split]
        if len(mine):
            parts += [f"## {title}", _winners(mine, words), folded(_ERRORS, _error_table(mine, words))]
    parts += ["## Intervals", _coverage_sentence(table, words), folded(_COVERED, _coverage(table, words))]
    parts += ["## Published figures", _published(published, table)]
    parts += ["## Mechanisms", folded(_FOUND, _mechanisms(mechanisms))]
    parts += ["## Cost", folded(_SPENT, _costs(costs, words))]
    return "\n\n".join(parts) + "\n"


def folded(title: str, table: str) -> str:
    """A table that a reader opens, under a title, as the Markdown of GitHub and of MyST."""
    return f"<details><summary>{title}</summary>\n\n{table}\n\n</details>"


def _lead(table: pd.DataFrame, ours: set[str]) -> str:
    """In how many rows of all tables the best method rests on a diagnosis, and in how many it does not."""
    ahead: dict[bool, list[bool]] = {True: [], False: []}
    for _, part in table.groupby(["split", "data"]):
        diagnosed = part["method"].isin(ours).to_numpy()
        wins = bool(diagnosed[part["rms_mm"].argmin()])
        ahead[wins].append(bool((part["ratio_to_best_low"][diagnosed != wins] > 1.0).all()))
    won, lost = ahead[True], ahead[False]
    return (
        f"A method that diagnoses has the smallest RMS error in {len(won)} of {len(won) + len(lost)} rows, in {sum(won)} with"
        f" 95 % confidence against each other method; another has it in {len(lost)}, in {sum(lost)} with that confidence."
    )


def _winners(table: pd.DataFrame, words: Mapping[str, str]) -> str:
    """How often each method has the smallest RMS error on one split."""
    best = table.loc[table.groupby("data")["rms_mm"].idxmin(), "method"].map(words)
    counts = best.value_counts()
    each = ", ".join(f"{name} {count}" for name, count in counts.items())
    return f"Smallest RMS error of {counted(len(best), 'data set')}: {each}."


def _coverage_sentence(table: pd.DataFrame, words: Mapping[str, str]) -> str:
    """The middle of the coverages of each method, and their range."""
    covered = table.dropna(subset="covered").groupby("method", sort=False)["covered"]
    each = [
        f"{words[str(name)]} {100 * part.median():.0f} % (from {100 * part.min():.0f} to {100 * part.max():.0f})"
        for name, part in covered
    ]
    return f"Median over data sets and splits: {'; '.join(each)}."


def _error_table(table: pd.DataFrame, words: Mapping[str, str]) -> str:
    """Errors of all methods on one split, a row for each data set, as Markdown.

    `table`: rows of `table.league_table` of one split. `words`: methods by what they are called.
    """
    rows = []
    for name in dict.fromkeys(table["data"]):
        part = table[table["data"] == name].to_dict("records")
        row: dict[str, Any] = {"data": _words(name), "poses": part[0]["poses"]}
        best = min(each["rms_mm"] for each in part)
        for each in part:
            digits = _digits(each["rms_mm"])
            rms, low, high, most = (f"{each[key]:.{digits}f}" for key in ("rms_mm", "rms_low_mm", "rms_high_mm", "max_mm"))
            shown = f"**{rms}**" if each["rms_mm"] == best else rms
            row[words[each["method"]]] = f"{shown} ({low}–{high}), {most}"
        rows.append(row)
    return markdown(rows)


def _coverage(table: pd.DataFrame, words: Mapping[str, str]) -> str:
    rows: dict[tuple[str, str], dict[str, Any]] = {}
    for each in table.dropna(subset="covered").to_dict("records"):
        row = rows.setdefault((each["data"], each["split"]), {"data": _words(each["data"]), "split": each["split"]})
        row[words[each["method"]]] = f"{100 * each['covered']:.1f} %"
    return markdown(list(rows.values()))


def _published(published: pd.DataFrame, table: pd.DataFrame) -> str:
    ours = table[table["split"] == RANDOM].groupby("data")["rms_mm"].min().to_dict()
    rows = [
        {"data": _words(each["data"]), "published, mm": each["rms_mm"], "what": each["what"], "source": each["source"]}
        | {"best here, RMS of unseen poses, mm": f"{ours[each['data']]:.{_digits(ours[each['data']])}f}", "why": each["why"]}
        for each in published.to_dict("records")
        if each["data"] in ours
    ]
    return markdown(rows)


def _mechanisms(table: pd.DataFrame) -> str:
    shown = table[table["probability_high"] >= _LEAST_PROBABLE].sort_values("share", ascending=False)
    rows = []
    for name in dict.fromkeys(table["data"]):
        for each in shown[shown["data"] == name].to_dict("records"):
            share, low, high = (100 * each[key] for key in ("share", "share_low", "share_high"))
            row = {"data": _words(name), "mechanism": _words(each["mechanism"])}
            row["probability"] = f"{each['probability']:.2f} ({each['probability_low']:.2f}–{each['probability_high']:.2f})"
            rows.append(row | {"share of the squared error": f"{share:.0f} % ({low:.0f}–{high:.0f})"})
    return markdown(rows)


def _costs(costs: pd.DataFrame, words: Mapping[str, str]) -> str:
    rows: dict[str, dict[str, Any]] = {}
    for each in costs[costs["split"] == RANDOM].to_dict("records"):
        row = rows.setdefault(each["data"], {"data": _words(each["data"])})
        row[words[each["method"]]] = f"{each['seconds_per_fold']:.1f} s, {each['memory_MB']:.0f} MB"
    return markdown(list(rows.values()))


def _words(name: str) -> str:
    return name.replace("_", " ")


def markdown(rows: list[dict[str, Any]]) -> str:
    """A table of which each row has its cells by the heads of their columns."""
    return pd.DataFrame(rows).fillna("").to_markdown(index=False, disable_numparse=True) if rows else "None."


def _digits(value: float) -> int:
    """Decimals that show three significant digits of a figure in mm, at most four."""
    return int(np.clip(2 - np.floor(np.log10(value)), 0, 4)) if value > 0 else 3
