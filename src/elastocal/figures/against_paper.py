"""Figures that hold the study against the paper's printed figures."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from elastocal.figures.style import PALETTE, note, panels, styled
from elastocal.study.printed import LEVEL
from elastocal.study.tables import find_statistics

MILLI = 1e3
_HEADS = {
    "k_sigma_20": "$k_\\Sigma$ at 20 (%)",
    "n_k_sigma_1_percent": "length until 1 %",
    "dev_20": "dev at 20 (µm)",
    "n_dev_2_um": "length until 2 µm",
}


@styled
def scores(comparison: pd.DataFrame, expectations: pd.DataFrame, titles: Mapping[str, str]) -> Figure:
    """Table 4 among studies of the same size: the paper's figures, how studies scatter, and what is expected of them.

    `comparison`, `expectations`: the tables of these names. `titles`: name of each robot to draw, by its key.
    """
    shown = comparison[(comparison.table == "4") & comparison.studies_mean.notna()]
    quantities, strategies = list(dict.fromkeys(shown.quantity)), list(dict.fromkeys(shown.strategy))
    if shown.empty:
        return note("the paper prints nothing of the robots of this study")
    figure, axes = panels(len(titles), len(quantities), 24 + 38 * len(titles), sharey=True)
    for line, (robot, title) in zip(axes, titles.items(), strict=True):
        for axis, quantity in zip(line, quantities, strict=True):
            cells = shown[(shown.robot == robot) & (shown.quantity == quantity)]
            rows = [strategies.index(strategy) for strategy in cells.strategy]
            look: dict[str, Any] = {"color": PALETTE[0], "markersize": 3, "elinewidth": 3, "alpha": 0.6}
            name = "further studies, mean ± 2 standard deviations"
            axis.errorbar(cells.studies_mean, rows, xerr=2 * cells.studies_std, fmt="o", label=name, **look)
            expected = _read_expected(expectations, robot, quantity)
            axis.plot(expected, [strategies.index(name) for name in expected.index], "|", color="black", markersize=8)
            for differs, colour, name in ((False, "white", "paper"), (True, PALETTE[1], "paper, differs (Holm)")):
                some = ((cells.p_holm < LEVEL) == differs).to_numpy()
                at = np.array(rows)[some]
                axis.plot(cells.paper[some], at, "D", color=colour, markeredgecolor="black", markersize=4, label=name)
            axis.set(title=_HEADS.get(quantity, quantity.replace("_", " ")), xlim=(0, None), ylim=(len(strategies) - 0.5, -0.5))
            axis.grid(visible=False, axis="y")
        line[0].set(yticks=range(len(strategies)), ylabel=title)
        line[0].set_yticklabels(strategies)
    handles = dict(zip(*reversed(axes[0, 0].get_legend_handles_labels()), strict=True))
    handles["expectation in closed form"] = axes[0, 0].lines[-3]
    figure.legend(handles.values(), handles.keys(), loc="outside lower center", ncols=2)
    return figure


def _read_expected(expectations: pd.DataFrame, robot: str, quantity: str) -> pd.Series:
    """Expectations of one quantity by strategy; none of lengths."""
    names = {f"{quantity}_percent_fixed_joints", f"{quantity}_um"}
    mine = expectations[(expectations.robot == robot) & expectations.quantity.isin(names) & expectations.paper.notna()]
    return mine.set_index("strategy").expected


@styled
def table2_samples(initial: Mapping[str, pd.DataFrame], reference: pd.DataFrame, titles: Mapping[str, str]) -> Figure:
    """Statistics of single data sets, in which the paper's Table 2 lies, although it is far from all data sets together.

    `initial`: the initial table of each robot. `reference`: the printed figures. `titles`: name of each robot to draw, by its
    key.
    """
    figure, axes = panels(1, 3, 66)
    printed = reference[reference.table == "2"].set_index(["robot", "quantity"]).value
    single = {robot: find_statistics(frame) for robot, frame in initial.items()}
    for axis, quantity in zip(axes[0], ("mean", "std", "max"), strict=True):
        for index, (robot, statistics) in enumerate(single.items()):
            low, q1, middle, q3, high = np.percentile(MILLI * statistics[quantity], [1, 25, 50, 75, 99])
            axis.plot([low, high], [index, index], color=PALETTE[index], linewidth=1)
            axis.plot([q1, q3], [index, index], color=PALETTE[index], linewidth=5, solid_capstyle="butt")
            axis.plot(middle, index, "o", color="white", markersize=3)
            if (robot, f"deviation_{quantity}") in printed.index:
                there = printed[robot, f"deviation_{quantity}"]
                axis.plot(there, index, "D", color="black", markersize=4, label="paper, Table 2")
        axis.set(title=quantity, xlabel="mm", yticks=range(len(initial)), ylim=(len(initial) - 0.5, -0.5), xlim=(0, None))
        axis.set_yticklabels([titles[robot] for robot in initial] if axis is axes[0, 0] else [])
        axis.grid(visible=False, axis="y")
    handles = dict(zip(*reversed(axes[0, 0].get_legend_handles_labels()), strict=True))
    title = "single data sets: 1 to 99 %, quartiles and median"
    figure.legend(handles.values(), handles.keys(), title=title, loc="outside lower center")
    return figure
