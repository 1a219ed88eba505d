"""What a robot misses after its targets were corrected, by the model that corrected them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from matplotlib.ticker import StrMethodFormatter

from elastocal.figures.style import PALETTE, panels, save, styled
from elastocal.io.origin import Origin

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_WORDS = {
    "uncorrected": "uncorrected",
    "geometry": "geometry alone",
    "declared": "geometry and springs",
    "found": "with the effects found",
    "true": "true model (floor)",
}
_PARTS = {"unloaded": "unloaded", "loaded": "under loads", "milling": "milling path"}


@styled
def closed_loop(table: pd.DataFrame) -> Figure:
    """Measured position errors, a panel for each part, a marker for each robot and model.

    `table`: of `closed_loop.summary`.
    """
    robots = [robot for robot in dict.fromkeys(table["robot"]) if robot != "all"]
    figure, axes = panels(1, len(_PARTS), 62, sharey=True, sharex=True)
    for axis, (part, words) in zip(axes[0], _PARTS.items(), strict=True):
        for number, robot in enumerate(robots):
            mine = table[(table["part"] == part) & (table["robot"] == robot)].set_index("model").loc[list(_WORDS)]
            place = np.arange(len(_WORDS))[::-1] + 0.22 * (0.5 * (len(robots) - 1) - number)
            limits = np.abs(mine[["rms_mm_low", "rms_mm_high"]].to_numpy().T - mine["rms_mm"].to_numpy())
            axis.errorbar(mine["rms_mm"], place, xerr=limits, fmt="o", ms=3.5, lw=1.2, color=PALETTE[number], label=robot)
        axis.set_xscale("log")
        axis.xaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
        axis.set_title(words)
        axis.set_xlabel("position error, RMS (mm)")
    axes[0, 0].set_yticks(np.arange(len(_WORDS))[::-1], list(_WORDS.values()))
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=max(len(robots), 1))
    return figure


def draw_closed_loop(job: Any) -> None:
    """The picture, from reports/closed_loop/closed_loop.csv."""
    save(closed_loop(pd.read_csv(job.input.summary)), job.output.figure, job.output.picture, Origin(**job.config["origin"]))
