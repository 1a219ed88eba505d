"""Rates of the blind proof as dots with their intervals: against the targets, and coverage of intervals."""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from elastocal.figures.style import PALETTE, note, panels, styled
from elastocal_proof.blind.scores import PROOF, TUNED, leading
from elastocal_proof.blind.targets import with_target, worded

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    import pandas as pd
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

LOOKS = {PROOF: (PALETTE[0], "o", "robots of the proof"), TUNED: ("#8a8a8a", "D", "robots on which it was developed")}
_COMPARABLE = {
    "exact": ("o", "the catalogue's own parameter"),
    "to first order": ("s", "the same to first order"),
    "by another law": ("^", "of another law than the catalogue's"),
    "all": ("D", "all together"),
}
_AIM = "#cfe8d5"
_LINE = 40
_PER_CENT, _FARTHEST = 100.0, 10.0


@styled
def rates_and_targets(summary: pd.DataFrame) -> Figure:
    """Every figure that has a target, with its interval and the range that the target leaves.

    `summary`: of reports/blind/summary.csv.
    """
    aimed = worded(with_target(summary))
    ratio = aimed.quantity.str.contains("over the oracle")
    names = [list(dict.fromkeys(part.quantity)) for part in (aimed[~ratio], aimed[ratio])]
    # Shares of what the best analyst finds may exceed all of it.
    largest = max(102.0, 1.05 * _PER_CENT * np.nanmax(aimed[~ratio].high.to_numpy(float), initial=0.0))
    heights = [max(len(part), 1) for part in names]
    figure, axes = panels(2, 1, 32 + 7.4 * sum(heights), height_ratios=heights)
    _dots(axes[0, 0], aimed[~ratio], names[0], lambda value: _PER_CENT * value)
    axes[0, 0].set(xlim=(-2, largest), xlabel="share of cases, or of what the best analyst finds (%)")
    _dots(axes[1, 0], aimed[ratio], names[1], lambda value: _PER_CENT * (value - 1.0))
    farthest = np.nanmax(np.abs(_PER_CENT * (aimed[ratio][["rate", "low", "high"]].to_numpy(float) - 1.0)), initial=6.0)
    axes[1, 0].set(xlim=(-1.1 * farthest, 1.1 * farthest), xlabel="held-out RMS above the oracle's (%)")
    present = [robots for robots in LOOKS if robots in set(aimed.robots)]
    handles: list[Artist] = [
        Line2D([], [], color=LOOKS[robots][0], marker=LOOKS[robots][1], markersize=4.5, linewidth=1.2, label=LOOKS[robots][2])
        for robots in present
    ]
    handles.append(Patch(color=_AIM, label="target"))
    figure.legend(handles=handles, title="bars are 95 % intervals", title_fontsize=7.5, loc="outside lower center", ncols=3)
    return figure


@styled
def coverage_by_effect(coverage: pd.DataFrame) -> Figure:
    """How often 95 % intervals contain the true value, for each kind of parameter.

    `coverage`: of reports/blind/coverage.csv.
    """
    whole = coverage[(coverage.parameter == "all") & (coverage.level.astype(str) == "all")]
    rows = whole[whole.robots == leading(whole.robots)]
    if rows.empty:
        return note("This run has no interval that a true value can be compared with.")
    of_effects = rows[rows.kind == "effect"].sort_values(["effect"])
    order = [
        *_rows(rows[rows.kind != "effect"]),
        *_rows(of_effects[of_effects.effect == "all"]),
        *_rows(of_effects[of_effects.effect != "all"]),
    ]
    figure, axes = panels(1, 1, 34 + 5.2 * max(len(order), 2))
    axis = axes[0, 0]
    axis.axvspan(92, 98, color=_AIM, zorder=0)
    axis.axvline(95, color="black", linewidth=0.8, linestyle=":")
    for place, row in enumerate(order):
        marker = _COMPARABLE[row.comparable][0]
        axis.plot([_PER_CENT * row.low, _PER_CENT * row.high], [place, place], color=PALETTE[0], linewidth=1.2)
        axis.plot(_PER_CENT * row.rate, place, marker, color=PALETTE[0], markersize=4.5)
        axis.annotate(f"{row.cases}", (1.01, place), xycoords=("axes fraction", "data"), va="center", fontsize=7)
    lowest = min([_PER_CENT * row.low for row in order])
    axis.set(yticks=range(len(order)), ylim=(len(order) - 0.5, -0.5), xlim=(min(80.0, lowest - 2), 100.5))
    axis.set_yticklabels([_coverage_name(row) for row in order], fontsize=7)
    axis.set_xlabel("95 % intervals that contain the true value (%)")
    axis.annotate("intervals", (1.01, -0.9), xycoords=("axes fraction", "data"), va="center", fontsize=7, annotation_clip=False)
    axis.grid(visible=False, axis="y")
    present = {row.comparable for row in order}
    handles: list[Artist] = [
        Line2D([], [], color=PALETTE[0], marker=marker, markersize=4.5, linewidth=1.2, label=label)
        for key, (marker, label) in _COMPARABLE.items()
        if key in present
    ]
    handles.append(Patch(color=_AIM, label="target, 92 to 98 %"))
    figure.legend(handles=handles, loc="outside lower center", ncols=3)
    return figure


def _rows(table: pd.DataFrame) -> Iterator[Any]:
    """Rows of a table; their attributes are its columns."""
    return table.itertuples()


def _coverage_name(row: Any) -> str:
    if row.kind == "effect":
        return "parameters of all effects" if row.effect == "all" else row.effect.replace("_", " ")
    return "joint " + row.kind.replace("compliance, ", "compliances, ")


def _dots(axis: Axes, rows: pd.DataFrame, names: list[str], scaled: Callable[[float], float]) -> None:
    robots = [key for key in LOOKS if key in set(rows.robots)]
    for aim in _rows(rows.drop_duplicates("quantity")):
        place: float = names.index(aim.quantity)
        # A target without an upper end goes as far as anything is drawn.
        low, high = scaled(aim.target_low), scaled(min(aim.target_high, _FARTHEST))
        # A target of a single value is a line that can be seen.
        axis.barh(place, max(high - low, 0.8), left=low - (0.4 if high == low else 0.0), height=0.86, color=_AIM, zorder=0)
    for number, key in enumerate(robots):
        color, marker, _ = LOOKS[key]
        for row in _rows(rows[rows.robots == key]):
            place = names.index(row.quantity) + 0.32 * (number - (len(robots) - 1) / 2)
            if not np.isfinite(row.rate):
                # The interval of nothing is everything, which would look like a result.
                axis.annotate(
                    "no cases", (0.01, place), xycoords=("axes fraction", "data"), va="center", color=color, fontsize=7
                )
                continue
            axis.plot([scaled(row.low), scaled(row.high)], [place, place], color=color, linewidth=1.2)
            axis.plot(scaled(row.rate), place, marker, color=color, markersize=4.2)
    axis.set(yticks=range(len(names)), ylim=(len(names) - 0.4, -0.6))
    axis.set_yticklabels([textwrap.fill(name, _LINE) for name in names], fontsize=7)
    axis.grid(visible=False, axis="y")
    axis.set_axisbelow(True)
