"""Held-out errors of several campaigns, before and after, on one axis."""

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from elastocal.counting import counted
from elastocal.figures.style import PALETTE, label_decades, panels, styled

_STAGES = (("before", "declared model", PALETTE[1]), ("after", "with the effects found", PALETTE[0]))


@styled
def campaign_errors(table: pd.DataFrame) -> Figure:
    """Root mean square errors with their intervals, a line for each campaign.

    `table`: ``campaign``, ``poses``, and ``before_rms_mm``, ``before_rms_low_mm``, ``before_rms_high_mm``, the same for after:
    mm.
    """
    rows = np.arange(len(table))[::-1]
    figure, axes = panels(1, 1, 24 + 6 * len(table))
    axis = axes[0, 0]
    axis.hlines(rows, table["after_rms_mm"], table["before_rms_mm"], color="#c8c8c8", lw=2.5, zorder=1)
    for stage, words, color in _STAGES:
        rms, low, high = (table[f"{stage}_rms{end}_mm"].to_numpy(float) for end in ("", "_low", "_high"))
        # An interval that is open above is drawn to the value alone.
        span = [rms - low, np.where(np.isfinite(high), high - rms, 0.0)]
        axis.errorbar(rms, rows, xerr=span, fmt="o", color=color, ms=4, lw=1.2, capsize=2, label=words, zorder=2)
    names = table["campaign"].str.replace("_", " ")
    # A campaign with two sessions has two lines.
    names = names.where(~names.duplicated(keep=False), names + ", " + table["poses"].map(lambda count: counted(count, "pose")))
    axis.set_yticks(rows, names)
    axis.set(xscale="log", xlabel="RMS position error of held-out poses (mm), with 95 % intervals")
    label_decades(axis.xaxis)
    axis.grid(visible=False, axis="y")
    figure.legend(loc="outside lower center", ncols=2)
    return figure
