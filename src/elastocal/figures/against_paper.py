"""Figures that hold the study against the paper's printed figures."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from elastocal.figures.style import PALETTE, panels, styled
from elastocal.study.comparison import ACCEPTED_Z

if TYPE_CHECKING:
    from collections.abc import Mapping

    import pandas as pd
    from matplotlib.figure import Figure

MILLI = 1e3
# Beyond this, a z score is drawn at the margin with an arrow.
_MARGIN = 8.0


@styled
def scores(comparison: pd.DataFrame) -> Figure:
    """Distance of each printed figure from ours, in Monte Carlo standard deviations.

    Parameters
    ----------
    comparison : DataFrame
        The table of the same name.

    Returns
    -------
    matplotlib.figure.Figure
    """
    shown = comparison[comparison.table.isin(["2", "3", "4"]) & comparison.z.notna()].reset_index(drop=True)
    groups = shown.groupby([shown.table, shown.quantity], sort=False).ngroup().to_numpy()
    labels = [f"Table {table}: {quantity}" for table, quantity in dict.fromkeys(zip(shown.table, shown.quantity, strict=True))]
    figure, axes = panels(1, 1, 8 + 6.5 * len(labels))
    axis = axes[0, 0]
    axis.axvspan(-ACCEPTED_Z, ACCEPTED_Z, color="#eeeeee", zorder=0)
    axis.axvline(0, color="black", linewidth=0.7)
    for index, robot in enumerate(dict.fromkeys(shown.robot)):
        chosen = (shown.robot == robot).to_numpy()
        z, row = shown.z.to_numpy()[chosen], groups[chosen] + 0.22 * (index - 1)
        outside = np.abs(z) > _MARGIN
        axis.plot(z[~outside], row[~outside], "o", color=PALETTE[index], markersize=4, alpha=0.8, label=robot)
        for side, marker in ((-1, "<"), (1, ">")):
            far = outside & (np.sign(z) == side)
            axis.plot(np.full(far.sum(), side * _MARGIN), row[far], marker, color=PALETTE[index], markersize=5)
    axis.set(yticks=range(len(labels)), xlabel="(ours - paper) / Monte Carlo standard deviation; arrows lie beyond the margin")
    axis.set(xlim=(-_MARGIN - 0.5, _MARGIN + 0.5), ylim=(len(labels) - 0.5, -0.5))
    axis.set_yticklabels(labels)
    figure.legend(*axis.get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return figure


@styled
def table2_samples(initial: Mapping[str, pd.DataFrame], reference: pd.DataFrame, titles: Mapping[str, str]) -> Figure:
    """Statistics of single data sets, in which the paper's Table 2 lies, although it is far from all data sets together.

    Parameters
    ----------
    initial : dict of str to DataFrame
        The initial table of each robot.
    reference : DataFrame
        The printed figures.
    titles : dict of str to str
        Name of each robot to draw, by its key.

    Returns
    -------
    matplotlib.figure.Figure
    """
    figure, axes = panels(1, 3, 66)
    printed = reference[reference.table == "2"].set_index(["robot", "quantity"]).value
    quantities = {
        "mean": lambda frame: frame["mean"],
        "std": lambda frame: np.sqrt(frame.mean_square - frame["mean"] ** 2),
        "max": lambda frame: frame.maximum,
    }
    for axis, (quantity, of) in zip(axes[0], quantities.items(), strict=True):
        for index, (robot, frame) in enumerate(initial.items()):
            low, q1, middle, q3, high = np.percentile(MILLI * of(frame), [1, 25, 50, 75, 99])
            axis.plot([low, high], [index, index], color=PALETTE[index], linewidth=1)
            axis.plot([q1, q3], [index, index], color=PALETTE[index], linewidth=5, solid_capstyle="butt")
            axis.plot(middle, index, "o", color="white", markersize=3)
            if (robot, f"deviation_{quantity}") in printed.index:
                axis.plot(
                    printed[robot, f"deviation_{quantity}"], index, "D", color="black", markersize=4, label="paper, Table 2"
                )
        axis.set(title=quantity, xlabel="mm", yticks=range(len(initial)), ylim=(len(initial) - 0.5, -0.5), xlim=(0, None))
        axis.set_yticklabels([titles[robot] for robot in initial] if axis is axes[0, 0] else [])
        axis.grid(visible=False, axis="y")
    handles = dict(zip(*reversed(axes[0, 0].get_legend_handles_labels()), strict=True))
    note = "single data sets: 1 to 99 %, quartiles and median"
    figure.legend(handles.values(), handles.keys(), title=note, loc="outside lower center", title_fontsize=7.5)
    return figure
