"""The league as a page of text: every table in full."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from elastocal.counting import counted
from elastocal_proof.league.folds import BLOCKS, RANDOM, SESSION
from elastocal_proof.league.methods import DIAGNOSIS

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from typing import Any

    from elastocal_proof.league.methods import Method

    Row = Mapping[Any, Any]

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
    table = table.assign(best=table.groupby(["data", "split"])["rms_mm"].transform("min"))

    def error(each: Row) -> str:
        rms, low, high, most = (_shown(each[key], each["rms_mm"]) for key in ("rms_mm", "rms_low_mm", "rms_high_mm", "max_mm"))
        return f"{f'**{rms}**' if each['rms_mm'] == each['best'] else rms} ({low}–{high}), {most}"

    def covered(each: Row) -> str:
        return f"{100 * each['covered']:.1f} %"

    def cost(each: Row) -> str:
        return f"{each['seconds_per_fold']:.1f} s, {each['memory_MB']:.0f} MB"

    parts = [f"Left out: {_words(name)}, as {file} is missing." for name, file in missing.items()]
    parts.append(_lead(table, {name for name, method in methods.items() if method.physics == DIAGNOSIS}))
    for split, title in _TITLES.items():
        mine = table[table["split"] == split]
        if len(mine):
            counts = mine.loc[mine.groupby("data")["rms_mm"].idxmin(), "method"].map(words).value_counts()
            each = ", ".join(f"{name} {count}" for name, count in counts.items())
            winners = f"Smallest RMS error of {counted(int(counts.sum()), 'data set')}: {each}."
            parts += [f"## {title}", winners, folded(_ERRORS, _wide(mine, ["data", "poses"], words, error))]
    stated = table.dropna(subset="covered")
    parts += ["## Intervals", _coverage_sentence(stated, words)]
    parts += [folded(_COVERED, _wide(stated, ["data", "split"], words, covered))]
    parts += ["## Published figures", _published(published, table)]
    parts += ["## Mechanisms", folded(_FOUND, _mechanisms(mechanisms))]
    parts += ["## Cost", folded(_SPENT, _wide(costs[costs["split"] == RANDOM], ["data"], words, cost))]
    return "\n\n".join(parts) + "\n"


def folded(title: str, table: str) -> str:
    """A table that a reader opens, under a title, as the Markdown of GitHub and of MyST."""
    return f"<details><summary>{title}</summary>\n\n{table}\n\n</details>"


def markdown(rows: list[dict[str, Any]]) -> str:
    """A table of which each row has its cells by the heads of their columns."""
    return pd.DataFrame(rows).fillna("").to_markdown(index=False, disable_numparse=True) if rows else "None."


def _wide(table: pd.DataFrame, heads: list[str], words: Mapping[str, str], cell: Callable[[Row], str]) -> str:
    """A row for each of `heads`, a column for each method."""
    rows: dict[tuple[Any, ...], dict[str, Any]] = {}
    for each in table.to_dict("records"):
        key = tuple(each[head] for head in heads)
        named = {head: _words(each[head]) if head == "data" else each[head] for head in heads}
        rows.setdefault(key, named)[words[each["method"]]] = cell(each)
    return markdown([*rows.values()])


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


def _coverage_sentence(stated: pd.DataFrame, words: Mapping[str, str]) -> str:
    """The middle of the coverages of each method, and their range."""
    each = [
        f"{words[str(name)]} {100 * part.median():.0f} % (from {100 * part.min():.0f} to {100 * part.max():.0f})"
        for name, part in stated.groupby("method", sort=False)["covered"]
    ]
    return f"Median over data sets and splits: {'; '.join(each)}."


def _published(published: pd.DataFrame, table: pd.DataFrame) -> str:
    ours = table[table["split"] == RANDOM].groupby("data")["rms_mm"].min().to_dict()
    rows = []
    for each in published[published["data"].isin(list(ours))].to_dict("records"):
        best = ours[each["data"]]
        row = {"data": _words(each["data"]), "published, mm": each["rms_mm"], "what": each["what"], "source": each["source"]}
        rows.append(row | {"best here, RMS of unseen poses, mm": _shown(best, best), "why": each["why"]})
    return markdown(rows)


def _mechanisms(table: pd.DataFrame) -> str:
    place = {name: number for number, name in enumerate(dict.fromkeys(table["data"]))}
    shown = table[table["probability_high"] >= _LEAST_PROBABLE].sort_values("share", ascending=False)
    shown = shown.sort_values("data", key=lambda data: data.map(place), kind="stable")
    rows = []
    for each in shown.to_dict("records"):
        share, low, high = (100 * each[key] for key in ("share", "share_low", "share_high"))
        row = {"data": _words(each["data"]), "mechanism": _words(each["mechanism"])}
        row["probability"] = f"{each['probability']:.2f} ({each['probability_low']:.2f}–{each['probability_high']:.2f})"
        rows.append(row | {"share of the squared error": f"{share:.0f} % ({low:.0f}–{high:.0f})"})
    return markdown(rows)


def _words(name: str) -> str:
    return name.replace("_", " ")


def _shown(value: float, scale: float) -> str:
    """A figure in mm with the decimals that show three significant digits of another, at most four."""
    return f"{value:.{int(np.clip(2 - np.floor(np.log10(scale)), 0, 4)) if scale > 0 else 3}f}"
