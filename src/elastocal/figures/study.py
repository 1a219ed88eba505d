"""Figures of the study: strategies over the data set length, the study against the
paper, and the research questions."""

import re
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullLocator

from elastocal.figures.style import (
    MICRO,
    PALETTE,
    add_legend_below,
    choose_line_style,
    create_panels,
    draw_note,
    label_decades,
    styled,
)
from elastocal.study.printed import SIGNIFICANCE_LEVEL

# Of the linear panels of the noise impact: what a reader compares with the wanted
# accuracy.
_LINEAR_UM = 20.0
_LENGTH = "configurations in the data set"
_BANDS = "bands: ± one Monte Carlo standard error; one estimator under several names is drawn once"
_HEADS = {
    "k_sigma_20": "$k_\\Sigma$ at 20 (%)",
    "n_k_sigma_1_percent": "length until 1 %",
    "dev_20": "dev at 20 (µm)",
    "n_dev_2_um": "length until 2 µm",
}
_DESIGNS = {"random": "random", "A": "A-optimal", "D": "D-optimal", "I": "I-optimal"}


@styled
def draw_noise_impact(
    metrics: pd.DataFrame, strategy: str, titles: Mapping[str, str]
) -> Figure:
    """Figure 4: deviation of one strategy against the data set length, for each noise
    level.

    `metrics`: long. `titles`: name of each robot to draw, by its key.
    """
    figure, axes = create_panels(2, len(titles), 118, sharex=True, sharey="row")
    for column, (robot, title) in zip(axes.T, titles.items(), strict=True):
        cells = metrics[(metrics.robot == robot) & (metrics.strategy == strategy)]
        for axis in column:
            for index, (noise, cell) in enumerate(cells.groupby("noise_um")):
                trusted = cell[cell.trustworthy]
                axis.plot(
                    cell.length,
                    MICRO * cell.deviation,
                    color=PALETTE[index],
                    linewidth=0.5,
                    alpha=0.5,
                )
                axis.plot(
                    trusted.length,
                    MICRO * trusted.deviation,
                    color=PALETTE[index],
                    label=f"{noise:g}",
                )
                # By factors, which keeps a band on a logarithmic axis where the error
                # is as large as the value.
                spread = np.exp(trusted.deviation_std_error / trusted.deviation)
                value = MICRO * trusted.deviation
                axis.fill_between(
                    trusted.length,
                    value / spread,
                    value * spread,
                    color=PALETTE[index],
                    alpha=0.12,
                    linewidth=0,
                )
        column[0].set(title=title, yscale="log", ylim=(1e-4, 3000))
        column[0].yaxis.set_major_formatter("{x:g}")
        column[1].set(
            xlabel=_LENGTH, xlim=(1, cells.length.max()), ylim=(0, _LINEAR_UM)
        )
    axes[0, 0].set_ylabel("dev, equation 15 (µm)")
    axes[1, 0].set_ylabel("the same, linear (µm)")
    title = "noise (µm and µrad); bands: a standard error as a factor; thin: some ĉ ≤ 0, or ĉ scatters by over a quarter"
    add_legend_below(figure, 5, title)
    return figure


@styled
def draw_stiffness_errors(
    metrics: pd.DataFrame,
    printed: pd.DataFrame,
    title: str,
    robot: str,
    order: Sequence[str],
    limit_percent: float,
) -> Figure:
    """Figures 5a and 5b: summed stiffness error of all strategies against the data set
    length, under both counts of joints.

    `metrics`: long, of one noise level. `printed`: the printed figures; those of
    k_sigma are taken to count the joints fixed in the last stage. `order`: strategies.
    `limit_percent`: marked by a line.
    """
    figure, axes = create_panels(1, 2, 96, sharey=True)
    counts = {
        "k_sigma": "all joints (equation 14)",
        "k_sigma_fixed_joints": "joints fixed in the last stage",
    }
    for axis, (quantity, count) in zip(axes[0], counts.items(), strict=True):
        _strategy_lines(axis, metrics, robot, quantity, 1.0, order)
        _limit(axis, limit_percent, "%")
        axis.set(title=count, xlabel=_LENGTH)
    _printed_marks(axes[0, 1], printed, robot, "k_sigma", order)
    figure.suptitle(title, fontsize=9)
    axes[0, 0].set(ylabel=r"$k_\Sigma$ (%)", yscale="log", ylim=(0.3, 40))
    label_decades(axes[0, 0].yaxis)
    add_legend_below(figure, 4, _BANDS)
    return figure


@styled
def draw_deviations(
    metrics: pd.DataFrame,
    printed: pd.DataFrame,
    title: str,
    robot: str,
    order: Sequence[str],
    limit_um: float,
) -> Figure:
    """Figures 5c and 5d: deviation of all strategies against the data set length.

    `metrics`: long, of one noise level. `printed`: the printed figures. `order`:
    strategies. `limit_um`: marked by a line.
    """
    figure, axes = create_panels(1, 1, 92)
    axis = axes[0, 0]
    _strategy_lines(axis, metrics, robot, "deviation", MICRO, order)
    _limit(axis, limit_um, "µm")
    _printed_marks(axis, printed, robot, "dev", order)
    axis.set(
        title=title,
        xlabel=_LENGTH,
        ylabel="dev, equation 15 (µm)",
        yscale="log",
        ylim=(0.5, 80),
    )
    label_decades(axis.yaxis)
    add_legend_below(figure, 4, _BANDS)
    return figure


def _strategy_lines(
    axis: Axes,
    metrics: pd.DataFrame,
    robot: str,
    quantity: str,
    scale: float,
    order: Sequence[str],
) -> None:
    # Where the mean of 1/c exists in practice.
    mine = metrics[(metrics.robot == robot) & metrics.trustworthy]
    for index in _find_distinct(
        mine.pivot(index="length", columns="strategy", values=quantity), order
    ):
        cell = mine[mine.strategy == order[index]]
        style = choose_line_style(index)
        value = scale * cell[quantity]
        error = scale * cell[f"{quantity}_std_error"]
        axis.plot(cell.length, value, label=order[index], **style)
        axis.fill_between(
            cell.length,
            value - error,
            value + error,
            color=style["color"],
            alpha=0.12,
            linewidth=0,
        )
    axis.set_xlim(2, 1.02 * metrics.length.max())


def _find_distinct(curves: pd.DataFrame, order: Sequence[str]) -> list[int]:
    """Places of the strategies whose curve (a column each) no strategy before them has,
    to rounding."""
    found: list[int] = []
    for index, name in enumerate(order):
        same = (
            np.allclose(
                curves[name], curves[order[other]], rtol=1e-6, atol=0, equal_nan=True
            )
            for other in found
        )
        if name in curves and not any(same):
            found.append(index)
    return found


def _printed_marks(
    axis: Axes, printed: pd.DataFrame, robot: str, quantity: str, order: Sequence[str]
) -> None:
    """Scores that the paper prints at a length, and the lengths at which it has them
    reach a limit."""
    label = "the paper's Table 4"
    for row in printed[
        (printed.table == "4") & (printed.robot == robot) & printed.strategy.isin(order)
    ].itertuples():
        score = re.fullmatch(rf"{quantity}_(\d+)", str(row.quantity))
        reached = re.fullmatch(rf"n_{quantity}_([\d.]+)_\w+", str(row.quantity))
        if score or reached:
            place = (
                (float(score[1]), row.value)
                if score
                else (row.value, float(reached[1]) if reached else np.nan)
            )
            colour = choose_line_style(order.index(str(row.strategy)))["color"]
            axis.plot(
                *place,
                "D",
                color=colour,
                markeredgecolor="black",
                markersize=4,
                zorder=4,
                label=label,
            )
            label = "_same"


def _limit(axis: Axes, value: float, unit: str) -> None:
    axis.axhline(value, color="black", linewidth=0.7)
    place: dict[str, Any] = {
        "xycoords": ("axes fraction", "data"),
        "xytext": (2, 0),
        "textcoords": "offset points",
    }
    axis.annotate(f"{value:g} {unit}", (1, value), **place, va="center", fontsize=7.5)


@styled
def draw_scores(comparison: pd.DataFrame, titles: Mapping[str, str]) -> Figure:
    """Table 4 among studies of the same size: the paper's figures, and how studies
    scatter.

    `comparison`: the table of this name. `titles`: name of each robot to draw, by its
    key.
    """
    shown = comparison[(comparison.table == "4") & comparison.studies_mean.notna()]
    quantities = list(dict.fromkeys(shown.quantity))
    strategies = list(dict.fromkeys(shown.strategy))
    if shown.empty:
        return draw_note("the paper prints nothing of the robots of this study")
    figure, axes = create_panels(
        len(titles), len(quantities), 24 + 38 * len(titles), sharey=True
    )
    for line, (robot, title) in zip(axes, titles.items(), strict=True):
        for axis, quantity in zip(line, quantities, strict=True):
            cells = shown[(shown.robot == robot) & (shown.quantity == quantity)]
            rows = [strategies.index(strategy) for strategy in cells.strategy]
            look: dict[str, Any] = {
                "color": PALETTE[0],
                "markersize": 3,
                "elinewidth": 3,
                "alpha": 0.6,
            }
            name = "further studies, mean ± 2 standard deviations"
            axis.errorbar(
                cells.studies_mean,
                rows,
                xerr=2 * cells.studies_std,
                fmt="o",
                label=name,
                **look,
            )
            for differs, colour, name in (
                (False, "white", "paper"),
                (True, PALETTE[1], "paper, differs (Holm)"),
            ):
                some = ((cells.p_holm < SIGNIFICANCE_LEVEL) == differs).to_numpy()
                at = np.array(rows)[some]
                axis.plot(
                    cells.paper[some],
                    at,
                    "D",
                    color=colour,
                    markeredgecolor="black",
                    markersize=4,
                    label=name,
                )
            axis.set(
                title=_HEADS.get(quantity, quantity.replace("_", " ")),
                xlim=(0, None),
                ylim=(len(strategies) - 0.5, -0.5),
            )
            axis.grid(visible=False, axis="y")
        line[0].set(yticks=range(len(strategies)), ylabel=title)
        line[0].set_yticklabels(strategies)
    add_legend_below(figure, 2)
    return figure


@styled
def draw_ladder(table: pd.DataFrame) -> Figure:
    """Error of one data set by number of link springs, for each noise and length, of
    the first robot with links.

    `table`: from `ladder.ladder_table`.
    """
    if table.empty:
        return draw_note("no robot of this study has elastic links")
    table = table[table.robot == table.robot.iloc[0]]
    steps = table[table.chosen_percent.notna()]
    noises = list(dict.fromkeys(table.noise_um))
    figure, axes = create_panels(1, len(noises), 72, sharey=True)
    for axis, noise in zip(axes[0], noises, strict=True):
        for index, (length, cell) in enumerate(
            steps[steps.noise_um == noise].groupby("length")
        ):
            springs = cell.link_springs.astype(int)
            axis.plot(
                springs,
                cell.rms_um,
                color=PALETTE[index],
                label=f"{length}",
                marker="o",
                markersize=2.5,
            )
            # Where cross-validation stops: the larger the more often.
            axis.scatter(
                springs,
                cell.rms_um,
                s=0.9 * cell.chosen_percent,
                color=PALETTE[index],
                alpha=0.35,
                linewidths=0,
            )
        axis.set(
            title=f"noise {noise:g} µm and µrad",
            xlabel="link springs in the model",
            yscale="log",
        )
        axis.set_xticks(range(int(steps.link_springs.astype(int).max()) + 1))
        label_decades(axis.yaxis)
    axes[0, 0].set_ylabel("RMS error of one data set (µm)")
    title = "configurations in the data set; discs: share of data sets in which cross-validation stops there"
    add_legend_below(figure, 6, title)
    return figure


@styled
def draw_designs(
    table: pd.DataFrame, titles: Mapping[str, str], accuracy_um: float
) -> Figure:
    """Error that simulated data sets of random and optimal configurations leave, by
    their number.

    `table`: from `designs.simulated_designs_table`, of which loads in random directions
    are drawn. `titles`: name of each robot to draw, by its key. `accuracy_um`: marked
    by a line.
    """
    table = table[table.load == "random"]
    figure, axes = create_panels(1, len(titles), 80, sharey=True)
    for axis, (robot, title) in zip(axes[0], titles.items(), strict=True):
        for index, (kind, name) in enumerate(_DESIGNS.items()):
            cell = table[(table.robot == robot) & (table.design == kind)]
            axis.errorbar(
                cell.configurations,
                cell.rms_um,
                cell.rms_um_std_error,
                **choose_line_style(index),
                label=name,
            )
        axis.axhline(accuracy_um, color="black", linewidth=0.7)
        axis.set(title=title, xlabel="configurations", xscale="log", yscale="log")
        axis.set_xticks(
            sorted(set(table.configurations)),
            labels=[f"{size}" for size in sorted(set(table.configurations))],
        )
        axis.xaxis.set_minor_locator(NullLocator())
        label_decades(axis.yaxis)
    axes[0, 0].set_ylabel("RMS error of one data set (µm)")
    add_legend_below(
        figure, 4, f"bars: ± one Monte Carlo standard error; line: {accuracy_um:g} µm"
    )
    return figure
