"""Figures that compare strategies and noise levels over the data set length."""

import re
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from elastocal.figures.style import PALETTE, label_decades, line_style, panels, styled

MICRO = 1e6
# Of the linear panels of the noise impact: what a reader compares with the wanted accuracy.
_LINEAR_UM = 20.0
_LENGTH = "configurations in the data set"
_BANDS = "bands: ± one Monte Carlo standard error; one estimator under several names is drawn once"


@styled
def noise_impact(metrics: pd.DataFrame, strategy: str, titles: Mapping[str, str]) -> Figure:
    """Figure 4: deviation of one strategy against the data set length, for each noise level.

    `metrics`: long. `titles`: name of each robot to draw, by its key.
    """
    figure, axes = panels(2, len(titles), 118, sharex=True, sharey="row")
    for column, (robot, title) in zip(axes.T, titles.items(), strict=True):
        cells = metrics[(metrics.robot == robot) & (metrics.strategy == strategy)]
        for axis in column:
            for index, (noise, cell) in enumerate(cells.groupby("noise_um")):
                trusted = cell[cell.trustworthy]
                axis.plot(cell.length, MICRO * cell.deviation, color=PALETTE[index], linewidth=0.5, alpha=0.5)
                axis.plot(trusted.length, MICRO * trusted.deviation, color=PALETTE[index], label=f"{noise:g}")
                # By factors, which keeps a band on a logarithmic axis where the error is as large as the value.
                spread = np.exp(trusted.deviation_std_error / trusted.deviation)
                value = MICRO * trusted.deviation
                axis.fill_between(trusted.length, value / spread, value * spread, color=PALETTE[index], alpha=0.12, linewidth=0)
        column[0].set(title=title, yscale="log", ylim=(1e-4, 3000))
        column[0].yaxis.set_major_formatter("{x:g}")
        column[1].set(xlabel=_LENGTH, xlim=(1, cells.length.max()), ylim=(0, _LINEAR_UM))
    axes[0, 0].set_ylabel("dev, equation 15 (µm)")
    axes[1, 0].set_ylabel("the same, linear (µm)")
    title = "noise (µm and µrad); bands: a standard error as a factor; thin: some ĉ ≤ 0, or ĉ scatters by over a quarter"
    figure.legend(*axes[0, 0].get_legend_handles_labels(), title=title, loc="outside lower center", ncols=5)
    return figure


@styled
def stiffness_errors(
    metrics: pd.DataFrame, printed: pd.DataFrame, title: str, robot: str, order: Sequence[str], limit_percent: float
) -> Figure:
    """Figures 5a and 5b: summed stiffness error of all strategies against the data set length, under both counts of joints.

    `metrics`: long, of one noise level. `printed`: the printed figures; those of k_sigma are taken to count the
    joints fixed in the last stage. `order`: strategies. `limit_percent`: marked by a line.
    """
    figure, axes = panels(1, 2, 96, sharey=True)
    counts = {"k_sigma": "all joints (equation 14)", "k_sigma_fixed_joints": "joints fixed in the last stage"}
    for axis, (quantity, count) in zip(axes[0], counts.items(), strict=True):
        _strategy_lines(axis, metrics, robot, quantity, 1.0, order)
        _limit(axis, limit_percent, "%")
        axis.set(title=count, xlabel=_LENGTH)
    _printed_marks(axes[0, 1], printed, robot, "k_sigma", order)
    figure.suptitle(title, fontsize=9)
    axes[0, 0].set(ylabel=r"$k_\Sigma$ (%)", yscale="log", ylim=(0.3, 40))
    label_decades(axes[0, 0].yaxis)
    _legend_below(figure, axes, _BANDS)
    return figure


@styled
def deviations(
    metrics: pd.DataFrame, printed: pd.DataFrame, title: str, robot: str, order: Sequence[str], limit_um: float
) -> Figure:
    """Figures 5c and 5d: deviation of all strategies against the data set length.

    `metrics`: long, of one noise level. `printed`: the printed figures. `order`: strategies. `limit_um`: marked by a line.
    """
    figure, axes = panels(1, 1, 92)
    axis = axes[0, 0]
    _strategy_lines(axis, metrics, robot, "deviation", MICRO, order)
    _limit(axis, limit_um, "µm")
    _printed_marks(axis, printed, robot, "dev", order)
    axis.set(title=title, xlabel=_LENGTH, ylabel="dev, equation 15 (µm)", yscale="log", ylim=(0.5, 80))
    label_decades(axis.yaxis)
    _legend_below(figure, axes, _BANDS)
    return figure


@styled
def over_studies(studies: pd.DataFrame, printed: pd.DataFrame, titles: Mapping[str, str], order: Sequence[str]) -> Figure:
    """k_sigma over the fixed joints and deviation against the data set length: mean over studies and how they scatter.

    `studies`: robot and the columns of `table_schemas.repeated`. `printed`: the printed figures. `titles`: name of each robot
    to draw, by its key. `order`: strategies; one estimator under several names is drawn once, under the first of them.
    """
    figure, axes = panels(2, len(titles), 118, sharex=True, sharey="row")
    quantities = (("k_sigma_fixed_joints", 1.0, "k_sigma", (0.2, 20)), ("deviation", MICRO, "dev", (0.5, 40)))
    for column, (robot, title) in zip(axes.T, titles.items(), strict=True):
        for axis, (quantity, scale, name, span) in zip(column, quantities, strict=True):
            mine = studies[studies.robot == robot]
            means = mine.pivot_table(index="length", columns="strategy", values=quantity, observed=True)
            for index in _find_distinct(means, order):
                strategy, style = order[index], line_style(index)
                curves = scale * mine[mine.strategy == strategy].pivot(index="study", columns="length", values=quantity)
                middle, spread = curves.mean(), curves.std()
                axis.plot(middle.index, middle, label=strategy, **style)
                axis.fill_between(middle.index, middle - spread, middle + spread, color=style["color"], alpha=0.12, linewidth=0)
            _printed_marks(axis, printed, robot, name, order)
            # A margin on the right, where diamonds at the longest length would be cut in halves.
            axis.set(xscale="log", yscale="log", xlim=(8, 1.05 * studies.length.max()), ylim=span)
            label_decades(axis.xaxis, axis.yaxis)
        column[0].set_title(title)
        column[1].set_xlabel(_LENGTH)
    axes[0, 0].set_ylabel(r"$k_\Sigma$ of the fixed joints (%)")
    axes[1, 0].set_ylabel("dev, equation 15 (µm)")
    bands = "bands: ± one standard deviation between studies"
    _legend_below(figure, axes, f"{bands}; one estimator under several names is drawn once")
    return figure


@styled
def bias_and_accuracy(
    metrics: pd.DataFrame, per_dataset: pd.DataFrame, titles: Mapping[str, str], order: Sequence[str], accuracy_um: float
) -> Figure:
    """What the paper's metric hides: the bias of the averaged model against the error that one data set leaves.

    `metrics`: long, of one noise level. `per_dataset`: the table of the same name, of the same noise level. `titles`: name of
    each robot to draw, by its key. `order`: strategies to draw. `accuracy_um`: wanted; marked by a line.
    """
    figure, axes = panels(1, len(titles), 92, sharey=True)
    for axis, (robot, title) in zip(axes[0], titles.items(), strict=True):
        for index, strategy in enumerate(order):
            averaged = metrics[(metrics.robot == robot) & (metrics.strategy == strategy) & (metrics.length > 1)]
            single = per_dataset[(per_dataset.robot == robot) & (per_dataset.strategy == strategy)]
            color = PALETTE[index]
            axis.fill_between(single.ds, single.mean_um, single.p95_um, color=color, alpha=0.13, linewidth=0)
            axis.plot(single.ds, single.rms_um, color=color, marker="o", markersize=3, label=f"{strategy}: one data set, RMS")
            bound = {"color": "black", "marker": "_", "markersize": 7, "linestyle": "none", "zorder": 3 + index}
            axis.plot(single.ds, single.crlb_rms_um, label=f"{strategy}: Cramér-Rao bound, RMS", **bound)
            label = f"{strategy}: dev of the paper"
            axis.plot(averaged.length, MICRO * averaged.deviation, color=color, linestyle="--", label=label)
        _limit(axis, accuracy_um, "µm")
        axis.set(title=title, xlabel=_LENGTH, xscale="log", yscale="log", xlim=(2, 100), ylim=(0.5, 2000))
        for plain in (axis.xaxis, axis.yaxis):
            plain.set_major_formatter("{x:g}")
    axes[0, 0].set_ylabel("end-effector error (µm)")
    handles, labels = axes[0, 0].get_legend_handles_labels()
    note = "bands: from the mean to the 95th percentile of one data set's error"
    figure.legend(handles, labels, title=note, loc="outside lower center", ncols=len(order))
    return figure


@styled
def accuracy_of_one_data_set(per_dataset: pd.DataFrame, titles: Mapping[str, str], order: Sequence[str], length: int) -> Figure:
    """Error that one data set of a given length leaves, strategy by strategy, beside the bound of its own measurements.

    `per_dataset`: the table of the same name, of one noise level. `titles`: name of each robot to draw, by its key. `order`:
    strategies.
    """
    figure, axes = panels(1, len(titles), 72, sharey=True)
    rows = np.arange(len(order))[::-1]
    for axis, (robot, title) in zip(axes[0], titles.items(), strict=True):
        cell = per_dataset[(per_dataset.robot == robot) & (per_dataset.ds == length)].set_index("strategy").loc[list(order)]
        errors = cell.rms_um_std_error
        axis.barh(rows, cell.rms_um, xerr=errors, height=0.6, color=PALETTE[5], ecolor="black", label="RMS error")
        axis.plot(cell.crlb_rms_um, rows, "|", color=PALETTE[1], markersize=14, markeredgewidth=2, label="Cramér-Rao bound")
        for row, efficiency in zip(rows, cell.efficiency, strict=True):
            axis.text(1, row, f"{100 * efficiency:.0f} %", va="center", fontsize=7.5)
        axis.set(title=title, xlabel="RMS end-effector error (µm)", yticks=rows)
        axis.set_yticklabels(order)
        axis.grid(visible=False, axis="y")
    figure.suptitle(f"one data set of {length} configurations; in the bars: efficiency, (bound / RMS)²", fontsize=9)
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=2)
    return figure


def _strategy_lines(axis: Axes, metrics: pd.DataFrame, robot: str, quantity: str, scale: float, order: Sequence[str]) -> None:
    # Where the mean of 1/c exists in practice.
    mine = metrics[(metrics.robot == robot) & metrics.trustworthy]
    for index in _find_distinct(mine.pivot(index="length", columns="strategy", values=quantity), order):
        cell, style = mine[mine.strategy == order[index]], line_style(index)
        value, error = scale * cell[quantity], scale * cell[f"{quantity}_std_error"]
        axis.plot(cell.length, value, label=order[index], **style)
        axis.fill_between(cell.length, value - error, value + error, color=style["color"], alpha=0.12, linewidth=0)
    axis.set_xlim(2, 1.02 * metrics.length.max())


def _find_distinct(curves: pd.DataFrame, order: Sequence[str]) -> list[int]:
    """Places of the strategies whose curve (a column each) no strategy before them has, to rounding."""
    found: list[int] = []
    for index, name in enumerate(order):
        same = (np.allclose(curves[name], curves[order[other]], rtol=1e-6, atol=0, equal_nan=True) for other in found)
        if name in curves and not any(same):
            found.append(index)
    return found


def _legend_below(figure: Figure, axes: np.ndarray, title: str) -> None:
    """One legend of all panels, each entry once."""
    handles = {label: handle for axis in axes.flat for handle, label in zip(*axis.get_legend_handles_labels(), strict=True)}
    figure.legend([*handles.values()], [*handles], title=title, loc="outside lower center", ncols=4)


def _printed_marks(axis: Axes, printed: pd.DataFrame, robot: str, quantity: str, order: Sequence[str]) -> None:
    """Scores that the paper prints at a length, and the lengths at which it has them reach a limit."""
    label = "the paper's Table 4"
    for row in printed[(printed.table == "4") & (printed.robot == robot) & printed.strategy.isin(order)].itertuples():
        score = re.fullmatch(rf"{quantity}_(\d+)", str(row.quantity))
        reached = re.fullmatch(rf"n_{quantity}_([\d.]+)_\w+", str(row.quantity))
        if score or reached:
            place = (float(score[1]), row.value) if score else (row.value, float(reached[1]) if reached else np.nan)
            colour = line_style(order.index(str(row.strategy)))["color"]
            axis.plot(*place, "D", color=colour, markeredgecolor="black", markersize=4, zorder=4, label=label)
            label = "_same"


def _limit(axis: Axes, value: float, unit: str) -> None:
    axis.axhline(value, color="black", linewidth=0.7)
    place: dict[str, Any] = {"xycoords": ("axes fraction", "data"), "xytext": (2, 0), "textcoords": "offset points"}
    axis.annotate(f"{value:g} {unit}", (1, value), **place, va="center", fontsize=7.5)
