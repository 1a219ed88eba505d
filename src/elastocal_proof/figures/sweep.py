"""How near relatives are named, against the angle between them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from elastocal.figures.style import PALETTE, panels, styled

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

_LOOKS = {
    "right": (PALETTE[2], "right name"),
    "class": (PALETTE[5], "class that holds it"),
    "wrong": (PALETTE[1], "wrong name"),
    "other": ("#d0d0d0", "other verdict"),
}
_COLUMNS = 4


@styled
def sweep(table: pd.DataFrame) -> Figure:
    """Stacked bars of the outcomes, a panel for each pair and one for all.

    `table`: sweep.csv.
    """
    pairs = list(dict.fromkeys(table["pair"])) or ["all"]
    bins = sorted(set(table["angle_up_to_deg"]))
    lines = -(-len(pairs) // _COLUMNS)
    figure, axes = panels(lines, _COLUMNS, 20 + 50 * lines, sharey=True)
    for pair, axis in zip(pairs, axes.flat, strict=False):
        mine = table[table["pair"] == pair]
        places, base = np.array([bins.index(angle) for angle in mine["angle_up_to_deg"]]), np.zeros(len(mine))
        for name, (colour, label) in _LOOKS.items():
            axis.bar(places, mine[name], 0.8, base, color=colour, label=label)
            base += mine[name].to_numpy(float)
        for place, count in zip(places, mine["cases"], strict=True):
            axis.text(place, 1.01, f"{count}", ha="center", va="bottom", fontsize=7)
        axis.set_xticks(range(len(bins)), [f"{angle:g}" for angle in bins])
        axis.set_title(pair.replace("_", " ").replace(" / ", " /\n"), pad=9)
        axis.set_xlabel("angle up to (°)")
    for axis in axes.flat[len(pairs) :]:
        axis.set_axis_off()
    for axis in axes[:, 0]:
        axis.set_ylabel("share of cases")
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=len(_LOOKS))
    return figure
