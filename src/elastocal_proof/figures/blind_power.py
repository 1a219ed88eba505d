"""Heat maps of the blind proof: what is found at which size beside the oracle, and the verdict for each ground truth."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.patches import Rectangle

from elastocal.figures.style import PALETTE, ink_on, note, panels, styled
from elastocal_proof.blind.confusion import PAIR, WORDS
from elastocal_proof.blind.scores import leading

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_PANELS = {
    "oracle_detected": "the oracle\ndetects",
    "detected": "detected",
    "held": "right name, alone\nor in a class",
    "named": "right name alone",
}
# Never black, so that the numbers can be read everywhere.
_SHARES = LinearSegmentedColormap.from_list("shares", ["#ffffff", "#c6dbef", "#4292c6", "#08519c"])
_PER_CENT = 100.0
_LEAST_WRITTEN = 0.045
_ALL, _NONE, _OUTSIDE = "all", "none", "outside:"


@styled
def power_map(power: pd.DataFrame) -> Figure:
    """Shares detected and named for each effect and size, beside the oracle that knows the effect.

    `power`: of reports/blind/power.csv.
    """
    single = power[(power.robots == leading(power.robots)) & (power.group == "single")]
    if single.empty:
        return note("This run has no case with one effect.")
    levels = sorted(single.level.unique())
    at_largest = single[single.level == max(levels)].set_index("effect")["named"]
    effects = sorted((name for name in at_largest.index if name != _ALL), key=lambda name: (-at_largest[name], name))
    effects += [name for name in (_ALL,) if name in set(single.effect)]
    figure, axes = panels(1, len(_PANELS), 34 + 4.6 * len(effects), sharey=True)
    table = single.set_index(["effect", "level"])
    for axis, (column, title) in zip(axes[0], _PANELS.items(), strict=True):
        shares = np.array([[_at(table, effect, level, column) for level in levels] for effect in effects])
        _heat(axis, shares, 6.5)
        axis.set(xticks=range(len(levels)), yticks=range(len(effects)), title=title, xlabel="non-centrality")
        axis.set_xticklabels([f"{level:g}" for level in levels])
        if _ALL in effects:
            axis.axhline(len(effects) - 1.5, color="black", linewidth=0.8)
    raw = set(single[single.level_of == "raw"].effect)
    axes[0, 0].set_yticklabels([_name(name) + (" *" if name in raw else "") for name in effects], fontsize=7)
    words = "Numbers are shares of cases in %."
    if raw:
        words += "\n* Wholly absorbed by the joint compliances: the size is that before absorption; not among all effects."
    figure.supxlabel(words, fontsize=7)
    return figure


@styled
def confusion_map(confusion: pd.DataFrame) -> Figure:
    """Verdicts by ground truth, at the largest sizes.

    `confusion`: of reports/blind/confusion.csv.
    """
    usual = confusion[(confusion.robots == leading(confusion.robots)) & (confusion.settings == "usual")]
    if usual.empty:
        return note("This run has no case in the usual setting.")
    largest = usual[usual.level == usual.groupby("truth")["level"].transform("max")].set_index("truth")
    counts = largest.drop(columns=["robots", "settings", "level"])
    named, words = [column for column in counts.columns if column not in WORDS], [*WORDS]
    groups: list[list[str]] = [
        [name for name in named if name in counts.index],
        [name for name in (PAIR,) if name in counts.index],
        sorted(name for name in counts.index if name.startswith(_OUTSIDE)),
        [name for name in (_NONE,) if name in counts.index],
    ]
    order = [name for group in groups for name in group]
    # A name that no verdict states, and that was nowhere true, needs no column.
    columns = [name for name in named if counts[name].any() or name in counts.index] + words
    shown = counts.loc[order, columns].to_numpy(float)
    totals = counts.loc[order].to_numpy(float).sum(axis=1)
    figure, axes = panels(1, 1, 48 + 3.9 * max(len(order), 4))
    axis = axes[0, 0]
    _heat(axis, shown / totals[:, None], 5.0)
    axis.set(xticks=range(len(columns)), yticks=range(len(order)))
    axis.set_xticklabels([_name(name) for name in columns], rotation=90, fontsize=6)
    axis.set_yticklabels([_name(name) for name in order], fontsize=6)
    axis.set(xlabel="verdict", ylabel="ground truth")
    axis.axvline(len(columns) - len(words) - 0.5, color="black", linewidth=0.8)
    for border in np.cumsum([len(group) for group in groups])[:-1]:
        axis.axhline(border - 0.5, color="black", linewidth=0.8)
    for place, name in enumerate(order):
        if name in columns:
            corner = columns.index(name) - 0.5, place - 0.5
            axis.add_patch(Rectangle(corner, 1, 1, fill=False, edgecolor=PALETTE[1], linewidth=0.9, zorder=4))
    for place, total in enumerate(totals):
        axis.annotate(f"{total:.0f}", (1.01, place), xycoords=("axes fraction", "data"), va="center", fontsize=5.5)
    axis.annotate("cases", (1.01, -1.0), xycoords=("axes fraction", "data"), va="center", fontsize=5.5, annotation_clip=False)
    return figure


def _at(table: pd.DataFrame, effect: str, level: float, column: str) -> float:
    return float(table[column].loc[(effect, level)]) if (effect, level) in table.index else np.nan


def _heat(axis: Axes, shares: np.ndarray, size: float) -> None:
    axis.imshow(np.ma.masked_invalid(shares), cmap=_SHARES, vmin=0, vmax=1, interpolation="nearest", aspect="auto")
    for row, column in np.argwhere(np.isfinite(shares)):
        if shares[row, column] >= _LEAST_WRITTEN:
            text = f"{_PER_CENT * shares[row, column]:.0f}"
            axis.text(column, row, text, ha="center", va="center", fontsize=size, color=ink_on(_SHARES(shares[row, column])))
    axis.tick_params(length=0)
    axis.grid(visible=False)
    axis.spines[:].set_visible(False)


def _name(name: str) -> str:
    known = {_ALL: "all effects", _NONE: "no effect", PAIR: "two effects"}
    return known.get(name, name.replace("_", " ").replace(_OUTSIDE, "outside: "))
