"""Held-out errors of the blind cases against those of the oracle that knows the effect."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeVar

import numpy as np
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullLocator

from elastocal.figures.style import PALETTE, panels, styled
from elastocal_proof.blind.scores import leading

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_MICRO = 1e6
_GROUPS = ("single", "pair")
_WITHIN = 1.05
# A logarithmic axis of less is marked like a linear one.
_DECADE = 4.0
# Smaller excesses over the oracle, in per cent, are shown to scale, larger ones by their logarithm.
_TO_SCALE = 0.1
_MARKS = (-10, -1, -0.1, 0, 0.1, 1, 5, 20, 100)

# A number or a column of a table.
_Ratio = TypeVar("_Ratio", "float", "pd.Series")


@styled
def errors_against_oracle(cases: pd.DataFrame) -> Figure:
    """Held-out RMS after the diagnosis against the oracle's, case by case, and the ratio of the two by size.

    `cases`: of reports/blind/cases.csv. A case without a held-out error, whose data are at fault, is not drawn.
    """
    mine = cases[(cases.robots == leading(cases.robots)) & cases.group.isin(_GROUPS)].dropna(
        subset=["oracle_rms_m", "after_rms_m"]
    )
    figure, axes = panels(1, 2, 82, width_ratios=(1, 1.1))
    left, right = axes[0]
    for detected, color, size in ((True, PALETTE[0], 5), (False, PALETTE[1], 7)):
        part = mine[mine.detected.astype(bool) == detected]
        left.scatter(_MICRO * part.oracle_rms_m, _MICRO * part.after_rms_m, s=size, color=color, alpha=0.5, linewidths=0)
    values = _MICRO * mine[["oracle_rms_m", "after_rms_m"]].to_numpy()
    low, high = (values.min() / 1.05, values.max() * 1.05) if len(mine) else (10.0, 1000.0)
    ends = np.array([low, high])
    left.plot(ends, ends, color="black", linewidth=0.8)
    left.plot(ends, _WITHIN * ends, color="black", linewidth=0.8, linestyle=":")
    left.set(xscale="log", yscale="log", xlim=ends, ylim=ends)
    left.set(xlabel="of the oracle (µm)", ylabel="after the diagnosis (µm)", title="held-out RMS, case by case")
    for axis in (left.xaxis, left.yaxis):
        axis.set_major_locator(MaxNLocator(5) if high < _DECADE * low else LogLocator(subs=(1.0, 2.0, 5.0)))
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axis.set_minor_locator(NullLocator())
    left.set_aspect("equal", adjustable="box")
    for number, (level, part) in enumerate(mine[mine.group == "single"].groupby("level")):
        _shares(right, part, PALETTE[number % len(PALETTE)], "-", f"one effect, non-centrality {level:g}")
    for number, (level, part) in enumerate(mine[mine.group == "pair"].groupby("level")):
        _shares(right, part, PALETTE[(number + 4) % len(PALETTE)], "--", f"two effects, {level:g} each")
    right.axvline(0.0, color="black", linewidth=0.8)
    right.axvline(_percent(_WITHIN), color="black", linewidth=0.8, linestyle=":")
    excess = _percent(mine.after_rms_m / mine.oracle_rms_m)
    limits = (min(-_TO_SCALE, excess.min()), max(10.0, excess.max())) if len(mine) else (-1.0, 10.0)
    right.set_xscale("symlog", linthresh=_TO_SCALE)
    right.set(xlim=(1.1 * limits[0], 1.1 * limits[1]), ylim=(0, 102))
    right.set_xticks([mark for mark in _MARKS if 1.1 * limits[0] <= mark <= 1.1 * limits[1]])
    right.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    right.xaxis.set_minor_locator(NullLocator())
    right.set(xlabel="RMS after the diagnosis above the oracle's (%)", ylabel="cases with no larger excess (%)")
    right.set_title("by the size of the effect")
    handles = [
        Line2D([], [], linestyle="", marker="o", color=PALETTE[0], markersize=4, label="detected"),
        Line2D([], [], linestyle="", marker="o", color=PALETTE[1], markersize=4, label="not detected"),
        Line2D([], [], color="black", linewidth=0.8, label="as good as the oracle"),
        Line2D([], [], color="black", linewidth=0.8, linestyle=":", label="5 % above it"),
        *right.get_legend_handles_labels()[0],
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=3)
    return figure


def _percent(ratio: _Ratio) -> _Ratio:
    return 100.0 * (ratio - 1.0)


def _shares(axis: Axes, part: pd.DataFrame, color: str, dashes: str, label: str) -> None:
    excess = np.sort(_percent(part.after_rms_m / part.oracle_rms_m).to_numpy())
    steps = 100.0 * np.arange(len(excess) + 1) / len(excess)
    axis.step([*excess, excess[-1]], steps, where="pre", color=color, linestyle=dashes, linewidth=1.2, label=label)
