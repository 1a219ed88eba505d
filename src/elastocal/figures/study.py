"""Figures of the study: strategies over the data set length, the study against the
paper, and the research questions.

The functions that start with ``draw_`` are named in workflow/rules/figures.smk.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import cycle
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullLocator

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
from elastocal.study.joint_test import SIGNIFICANCE_LEVEL

# Range of the linear panels of the noise impact: readers compare it with the accuracy
# that they want.
_LINEAR_RANGE_UM = 20.0
_LENGTH_LABEL = "configurations in the data set"
_BANDS_TITLE = (
    "bands: ± one Monte Carlo standard error; names of one estimator share a line"
)
_PRINTED_LABEL = "the paper's Table 4; marks at\nthe same length are spread"
# Configurations between the printed scores at one length, so that none hides another.
_SPREAD = 1.6
_QUANTITY_TITLES = {
    "k_sigma_20": "$k_\\Sigma$ at 20 (%)",
    "n_k_sigma_1_percent": "configurations\nfor 1 %",
    "dev_20": "dev at 20 (µm)",
    "n_dev_2_um": "configurations\nfor 2 µm",
}
_DESIGN_LABELS = {
    "random": "random",
    "A": "A-optimal",
    "D": "D-optimal",
    "I": "I-optimal",
}
_STUDIES_LABEL = "further studies, median and central 95 %"
_UNSEEN_LABEL = "values that the joint test would not reject"
_DIAMOND: dict[str, Any] = {
    "marker": "D",
    "linestyle": "",
    "markeredgecolor": "black",
    "markersize": 4,
}


@dataclass(frozen=True)
class _StrategyCurves:
    """Scores of all strategies on one robot against the data set length.

    Attributes
    ----------
    metrics
        Long table of metrics, of one noise level.
    printed
        The printed figures.
    robot : str
        Key of the robot.
    order
        Names of the strategies; their positions determine the line styles.
    """

    metrics: pd.DataFrame
    printed: pd.DataFrame
    robot: str
    order: Sequence[str]

    def draw_lines(self, axis: Axes, quantity: str, scale: float = 1.0) -> None:
        """Draw a scaled column of the metrics for each different estimator, at the
        lengths at which the mean of 1/c exists in practice; a label has all names of the
        estimator."""
        trusted = self._select_trusted()
        for index, names in self._group_names(quantity).items():
            cell = trusted[trusted.strategy == self.order[index]]
            style = choose_line_style(index)
            value = scale * cell[quantity]
            error = scale * cell[f"{quantity}_std_error"]
            axis.plot(cell.length, value, label=",\n".join(names), **style)
            _fill_band(axis, cell.length, value - error, value + error, style["color"])
        axis.set_xlim(2, 1.02 * self.metrics.length.max())

    def draw_printed_marks(self, axis: Axes, printed: str, quantity: str) -> None:
        """Draw the printed scores at a length, side by side, and the printed lengths at
        which scores reach a limit.

        `printed` is the printed score that the column `quantity` of the metrics is.
        """
        rows = self.printed[
            (self.printed.table == "4")
            & (self.printed.robot == self.robot)
            & self.printed.strategy.isin(self.order)
        ]
        groups = self._group_names(quantity)
        positions = [
            (_locate_printed_mark(printed, str(row.quantity), row.value), row.strategy)
            for row in rows.itertuples()
        ]
        is_score = rows.quantity.str.startswith(printed).to_numpy()
        sideways = np.where(is_score, _SPREAD * (np.cumsum(is_score) - 1), 0.0)
        sideways[is_score] -= sideways[is_score].mean() if is_score.any() else 0.0
        for (position, strategy), shift in zip(positions, sideways, strict=True):
            if position is None:
                continue
            first = next(i for i, names in groups.items() if strategy in names)
            color = choose_line_style(first)["color"]
            x, y = position
            axis.plot(x + shift, y, color=color, zorder=4, **_DIAMOND)
        if len(rows):
            axis.plot([], [], color="#bdbdbd", label=_PRINTED_LABEL, **_DIAMOND)

    def _select_trusted(self) -> pd.DataFrame:
        return self.metrics[
            (self.metrics.robot == self.robot) & self.metrics.trustworthy
        ]

    def _group_names(self, quantity: str) -> dict[int, list[str]]:
        """Names of each different estimator by the position of the first of them."""
        curves = self._select_trusted().pivot(
            index="length", columns="strategy", values=quantity
        )
        return _group_equal_curves(curves, self.order)


def _group_equal_curves(
    curves: pd.DataFrame, order: Sequence[str]
) -> dict[int, list[str]]:
    """Names of strategies with the same curve, up to rounding, by the position of the
    first of them.

    `curves` has a column for each strategy.
    """
    groups: dict[int, list[str]] = {}
    for index, name in enumerate(order):
        if name not in curves:
            continue
        for first, names in groups.items():
            first_curve = curves[order[first]]
            if np.allclose(
                curves[name], first_curve, rtol=1e-6, atol=0, equal_nan=True
            ):
                names.append(name)
                break
        else:
            groups[index] = [name]
    return groups


def _locate_printed_mark(
    quantity: str, printed: str, value: Any
) -> tuple[float, float] | None:
    """Length and score of a printed value of a quantity; None for other quantities."""
    score = re.fullmatch(rf"{quantity}_(\d+)", printed)
    if score:
        return float(score[1]), value
    reached = re.fullmatch(rf"n_{quantity}_([\d.]+)_\w+", printed)
    if reached:
        return value, float(reached[1])
    return None


def _fill_band(axis: Axes, x: Any, low: Any, high: Any, color: str) -> None:
    axis.fill_between(x, low, high, color=color, alpha=0.12, linewidth=0)


def _draw_limit(axis: Axes, value: float, unit: str) -> None:
    """Draw a horizontal line with its value at the right."""
    axis.axhline(value, color="black", linewidth=0.7)
    axis.annotate(
        f"{value:g} {unit}",
        (1, value),
        xycoords=("axes fraction", "data"),
        xytext=(2, 0),
        textcoords="offset points",
        va="center",
        fontsize=7.5,
    )


@styled
def draw_noise_impact(
    metrics: pd.DataFrame, strategy: str, titles: Mapping[str, str]
) -> Figure:
    """Figure 4: draw the deviation of one strategy against the data set length, for
    each noise level.

    Parameters
    ----------
    metrics
        Long table of metrics.
    strategy : str
    titles
        Name of each robot to draw, by its key.
    """
    figure, axes = create_panels(2, len(titles), 118, sharex=True, sharey="row")
    for column, (robot, title) in zip(axes.T, titles.items(), strict=True):
        cells = metrics[(metrics.robot == robot) & (metrics.strategy == strategy)]
        for axis in column:
            _draw_noise_levels(axis, cells)
        logarithmic, linear = column
        logarithmic.set(title=title, yscale="log", ylim=(1e-4, 3000))
        logarithmic.yaxis.set_major_formatter("{x:g}")
        linear.set(
            xlabel=_LENGTH_LABEL,
            xlim=(1, cells.length.max()),
            ylim=(0, _LINEAR_RANGE_UM),
        )
    axes[0, 0].set_ylabel("dev, equation 15 (µm)")
    axes[1, 0].set_ylabel("the same, linear (µm)")
    legend_title = (
        "noise (µm and µrad); bands: one Monte Carlo standard error, as a factor\n"
        "thin lines: a compliance ĉ ≤ 0 occurs, or one scatters by over a quarter"
    )
    add_legend_below(figure, 5, legend_title)
    return figure


def _draw_noise_levels(axis: Axes, cells: pd.DataFrame) -> None:
    """Draw the deviation at each noise level, thick with a band where it is
    trustworthy."""
    levels = cells.groupby("noise_um")
    for (noise, cell), color in zip(levels, cycle(PALETTE), strict=False):
        trusted = cell[cell.trustworthy]
        axis.plot(
            cell.length, MICRO * cell.deviation, color=color, linewidth=0.5, alpha=0.5
        )
        value = MICRO * trusted.deviation
        axis.plot(trusted.length, value, color=color, label=f"{noise:g}")
        # A factor keeps the band on a logarithmic axis even if the error is as large as
        # the value.
        factor = np.exp(trusted.deviation_std_error / trusted.deviation)
        _fill_band(axis, trusted.length, value / factor, value * factor, color)


@styled
def draw_stiffness_errors(
    metrics: pd.DataFrame,
    printed: pd.DataFrame,
    title: str,
    robot: str,
    order: Sequence[str],
    limit_percent: float,
) -> Figure:
    """Figures 5a and 5b: draw the summed stiffness error of all strategies against the
    data set length, under both counts of joints.

    Parameters
    ----------
    metrics, printed, robot, order
        As in `_StrategyCurves`. Both panels have the printed figures of k_sigma, because
        the paper does not say which joints it counts.
    title : str
        Name of the robot.
    limit_percent : float
        Marked by a line.
    """
    figure, axes = create_panels(1, 2, 112, sharey=True)
    curves = _StrategyCurves(metrics, printed, robot, order)
    panel_titles = {
        "k_sigma": "all joints (equation 14)",
        "k_sigma_fixed_joints": "joints fixed in the last stage",
    }
    for axis, (quantity, panel_title) in zip(
        axes[0], panel_titles.items(), strict=True
    ):
        curves.draw_lines(axis, quantity)
        _draw_limit(axis, limit_percent, "%")
        axis.set(title=panel_title, xlabel=_LENGTH_LABEL)
        curves.draw_printed_marks(axis, "k_sigma", quantity)
    figure.suptitle(title, fontsize=9)
    axes[0, 0].set(ylabel=r"$k_\Sigma$ (%)", yscale="log", ylim=(0.3, 40))
    label_decades(axes[0, 0].yaxis)
    add_legend_below(figure, 3, _BANDS_TITLE)
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
    """Figures 5c and 5d: draw the deviation of all strategies against the data set
    length.

    Parameters are as in `draw_stiffness_errors`; `limit_um` is marked by a line.
    """
    figure, axes = create_panels(1, 1, 108)
    axis = axes[0, 0]
    curves = _StrategyCurves(metrics, printed, robot, order)
    curves.draw_lines(axis, "deviation", MICRO)
    _draw_limit(axis, limit_um, "µm")
    curves.draw_printed_marks(axis, "dev", "deviation")
    axis.set(
        title=title,
        xlabel=_LENGTH_LABEL,
        ylabel="dev, equation 15 (µm)",
        yscale="log",
        ylim=(0.5, 80),
    )
    label_decades(axis.yaxis)
    add_legend_below(figure, 3, _BANDS_TITLE)
    return figure


@styled
def draw_scores(comparison: pd.DataFrame, titles: Mapping[str, str]) -> Figure:
    """Draw the printed figures of Table 4 among the scatter of studies of the same size.

    Parameters
    ----------
    comparison
        The table of this name.
    titles
        Name of each robot to draw, by its key.
    """
    shown = comparison[(comparison.table == "4") & comparison.studies_median.notna()]
    if shown.empty:
        return draw_note("the paper prints nothing of the robots of this study")
    quantities = list(dict.fromkeys(shown.quantity))
    strategies = list(dict.fromkeys(shown.strategy))
    height_mm = 24 + 38 * len(titles)
    figure, axes = create_panels(len(titles), len(quantities), height_mm, sharey=True)
    for panels, (robot, title) in zip(axes, titles.items(), strict=True):
        for axis, quantity in zip(panels, quantities, strict=True):
            cells = shown[(shown.robot == robot) & (shown.quantity == quantity)]
            rows = [strategies.index(strategy) for strategy in cells.strategy]
            _draw_scatter(axis, cells, np.array(rows))
            axis.set(
                title=_QUANTITY_TITLES.get(quantity, quantity.replace("_", " ")),
                xlim=(0, None),
                ylim=(len(strategies) - 0.5, -0.5),
            )
            axis.grid(visible=False, axis="y")
        panels[0].set(yticks=range(len(strategies)), ylabel=title)
        panels[0].set_yticklabels(strategies)
    add_legend_below(figure, 2)
    return figure


def _draw_scatter(axis: Axes, cells: pd.DataFrame, rows: np.ndarray) -> None:
    """Draw the range of the studies, the values that would not differ in the test of all
    figures, and the printed value of each cell in its row."""
    median = cells.studies_median
    for low, high, width, alpha, label in (
        (cells.unseen_low, cells.unseen_high, 1, 0.5, _UNSEEN_LABEL),
        (cells.studies_low, cells.studies_high, 4, 0.6, _STUDIES_LABEL),
    ):
        axis.errorbar(
            median,
            rows,
            xerr=[median - low, high - median],
            fmt="o",
            label=label,
            color=PALETTE[0],
            markersize=3,
            elinewidth=width,
            alpha=alpha,
        )
    differs = (cells.p_corrected < SIGNIFICANCE_LEVEL).to_numpy()
    for selected, color, label in (
        (~differs, "#bdbdbd", "paper, no significant difference"),
        (differs, PALETTE[1], "paper, significant difference"),
    ):
        axis.plot(
            cells.paper[selected], rows[selected], color=color, label=label, **_DIAMOND
        )


@styled
def draw_multiverse(table: pd.DataFrame) -> Figure:
    """Draw the ratio of the printed figures to ours, with each interpretation and with
    its alternative, by the quantity.

    Parameters
    ----------
    table
        From `study.multiverse.build_multiverse_table`.
    """
    if table.empty:
        return draw_note("the paper prints nothing of the robots of this study")
    numbers = sorted(set(table.interpretation), key=lambda number: int(number[1:]))
    groups = table.quantity.map(_QUANTITY_TITLES)
    groups = groups.where(table.table == "4", "Table " + table.table)
    titles = list(dict.fromkeys(groups))
    figure, axes = create_panels(1, len(titles), 26 + 6 * len(numbers), sharey=True)
    for axis, title in zip(axes[0], titles, strict=True):
        cells = table[groups == title].groupby("interpretation")
        factors = pd.DataFrame(
            {name: _find_median_factor(cells, name) for name in ("ours", "other")}
        ).reindex(numbers)
        rows = range(len(numbers))
        axis.hlines(rows, factors.ours, factors.other, color="#9a9a9a", linewidth=0.8)
        axis.plot(factors.ours, rows, "o", color=PALETTE[0], label="our interpretation")
        axis.plot(factors.other, rows, "D", color=PALETTE[1], label="alternative")
        axis.set(title=title, xscale="log", ylim=(len(numbers) - 0.5, -0.5))
        largest = max(3.0, float(np.nanmax(factors.to_numpy())))
        # The margin is a share of the logarithm, so that no diamond is cut at the edge.
        axis.set_xlim(largest**-0.06, largest**1.08)
        label_decades(axis.xaxis)
        if largest > 100.0:
            # Numbers between the decades would run into one another.
            axis.xaxis.set_major_locator(LogLocator(numticks=6))
        axis.grid(visible=False, axis="y")
    axes[0, 0].set_yticks(range(len(numbers)), labels=numbers)
    axes[0, 0].set_ylabel("interpretation")
    add_legend_below(
        figure, 2, "factor between the printed figures and ours (at least 1), median"
    )
    return figure


def _find_median_factor(cells: Any, name: str) -> pd.Series:
    """Median factor, at least 1, between a column and the paper in each group; a score
    of the other sign has no factor."""

    def find_median(cell: pd.DataFrame) -> float:
        ratio = cell[name] / cell.paper
        logarithm = pd.Series(np.log(ratio[ratio > 0.0]))
        return float(np.exp(logarithm.abs().median()))

    return cells.apply(find_median)


@styled
def draw_ladder(table: pd.DataFrame) -> Figure:
    """Draw the error of one data set by number of link springs, for each noise and
    length, of the first robot with links.

    Parameters
    ----------
    table
        From `study.ladder.build_ladder_table`.
    """
    if table.empty:
        return draw_note("no robot of this study has elastic links")
    first_robot = table[table.robot == table.robot.iloc[0]]
    steps = first_robot[first_robot.chosen_percent.notna()]
    noises = list(dict.fromkeys(first_robot.noise_um))
    figure, axes = create_panels(1, len(noises), 72, sharey=True)
    for axis, noise in zip(axes[0], noises, strict=True):
        by_length = steps[steps.noise_um == noise].groupby("length")
        for (length, cell), color in zip(by_length, cycle(PALETTE), strict=False):
            springs = cell.link_springs.astype(int)
            axis.plot(
                springs,
                cell.rms_um,
                color=color,
                label=f"{length}",
                marker="o",
                markersize=2.5,
            )
            # The size of a disc is the share of data sets in which cross-validation
            # stops there.
            axis.scatter(
                springs,
                cell.rms_um,
                s=0.9 * cell.chosen_percent,
                color=color,
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
    legend_title = (
        "configurations in the data set; "
        "discs: share of data sets in which cross-validation stops there"
    )
    add_legend_below(figure, 6, legend_title)
    return figure


@styled
def draw_designs(
    table: pd.DataFrame, titles: Mapping[str, str], accuracy_um: float
) -> Figure:
    """Draw the error that random and optimal configurations leave in simulated data
    sets, by their number.

    Parameters
    ----------
    table
        From `study.designs.build_designs_table`; only loads in random directions are
        drawn.
    titles
        Name of each robot to draw, by its key.
    accuracy_um : float
        Marked by a line.
    """
    table = table[table.load == "random"]
    sizes = sorted(set(table.configurations))
    figure, axes = create_panels(1, len(titles), 80, sharey=True)
    for axis, (robot, title) in zip(axes[0], titles.items(), strict=True):
        for index, (design, label) in enumerate(_DESIGN_LABELS.items()):
            cell = table[(table.robot == robot) & (table.design == design)]
            axis.errorbar(
                cell.configurations,
                cell.rms_um,
                cell.rms_um_std_error,
                **choose_line_style(index),
                label=label,
            )
        axis.axhline(accuracy_um, color="black", linewidth=0.7)
        axis.set(title=title, xlabel="configurations", xscale="log", yscale="log")
        axis.set_xticks(sizes, labels=[f"{size}" for size in sizes])
        axis.xaxis.set_minor_locator(NullLocator())
        label_decades(axis.yaxis)
    axes[0, 0].set_ylabel("RMS error of one data set (µm)")
    legend_title = f"bars: ± one Monte Carlo standard error; line: {accuracy_um:g} µm"
    add_legend_below(figure, 4, legend_title)
    return figure
