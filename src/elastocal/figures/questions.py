"""Figures of the research questions: springs that pay, points at an equal budget, chosen configurations, metrics."""

from collections.abc import Mapping

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.ticker import NullLocator

from elastocal.figures.style import PALETTE, label_decades, line_style, note, panels, styled
from elastocal.study.budget_tables import QUANTILE

_DESIGNS = {"random": "random", "A": "A-optimal", "D": "D-optimal", "I": "I-optimal", "bound": "bound of all designs"}


@styled
def ladder(table: pd.DataFrame) -> Figure:
    """Error of one data set by number of link springs, for each noise and length, of the first robot with links.

    `table`: from `question_tables.ladder_table`.
    """
    if table.empty:
        return note("no robot of this study has elastic links")
    table = table[table.robot == table.robot.iloc[0]]
    steps = table[table.chosen_percent.notna()]
    noises = list(dict.fromkeys(table.noise_um))
    figure, axes = panels(1, len(noises), 72, sharey=True)
    for axis, noise in zip(axes[0], noises, strict=True):
        for index, (length, cell) in enumerate(steps[steps.noise_um == noise].groupby("length")):
            springs = cell.link_springs.astype(int)
            axis.plot(springs, cell.rms_um, color=PALETTE[index], label=f"{length}", marker="o", markersize=2.5)
            # Where cross-validation stops: the larger the more often.
            axis.scatter(springs, cell.rms_um, s=0.9 * cell.chosen_percent, color=PALETTE[index], alpha=0.35, linewidths=0)
        axis.set(title=f"noise {noise:g} µm and µrad", xlabel="link springs in the model", yscale="log")
        axis.set_xticks(range(int(steps.link_springs.astype(int).max()) + 1))
        label_decades(axis.yaxis)
    axes[0, 0].set_ylabel("RMS error of one data set (µm)")
    title = "configurations in the data set; discs: share of data sets in which cross-validation stops there"
    figure.legend(*axes[0, 0].get_legend_handles_labels(), title=title, loc="outside lower center", ncols=6)
    return figure


@styled
def budget(table: pd.DataFrame, titles: Mapping[str, str], length: int) -> Figure:
    """Error of one data set by set of measuring points, with as many configurations and with as many measurements.

    `table`: from `budget_tables.budget_table`. `titles`: name of each robot to draw, by its key. `length`: configurations; the
    budget is twice as many measurements.
    """
    labels = list(dict.fromkeys(table.points))
    figure, axes = panels(1, len(titles), 16 + 7 * len(labels), sharex=True, sharey=True)
    for axis, (robot, title) in zip(axes[0], titles.items(), strict=True):
        mine = table[table.robot == robot]
        same = mine[mine.configurations == length]
        equal = mine[mine.configurations == 2 * length // mine.measurements_per_configuration]
        for cells, colour, shift, name in (
            (same, PALETTE[0], -0.16, f"{length} configurations each"),
            (equal, PALETTE[1], 0.16, f"{2 * length} measurements each"),
        ):
            rows = [labels.index(points) + shift for points in cells.points]
            spans = QUANTILE * cells.std_error_um
            axis.errorbar(cells.rms_um, rows, xerr=spans, fmt="o", color=colour, markersize=4, label=name)
            axis.plot(cells.crlb_rms_um, rows, "|", color="black", markersize=7, label="Cramér-Rao bound")
        axis.set(title=title, xlabel="RMS error of one data set (µm), 95 % intervals", yticks=range(len(labels)))
        axis.set(ylim=(len(labels) - 0.5, -0.5), xlim=(0, None))
        axis.grid(visible=False, axis="y")
    axes[0, 0].set_yticklabels(labels)
    handles = dict(zip(*reversed(axes[0, 0].get_legend_handles_labels()), strict=True))
    figure.legend(handles.values(), handles.keys(), loc="outside lower center", ncols=3)
    return figure


@styled
def costs(table: pd.DataFrame, titles: Mapping[str, str], accuracy_um: float) -> Figure:
    """Cost of an accuracy by each set of points over the first one, by the cost of a configuration.

    `table`: from `costs.cost_table`. `titles`: name of each robot to draw, by its key.
    """
    if not table.ratio.gt(0).any():
        return note(f"no set of points reaches {accuracy_um:g} µm with the configurations of this study")
    labels = list(dict.fromkeys(table.points))
    figure, axes = panels(1, len(titles), 78, sharey=True)
    for axis, (robot, title) in zip(axes[0], titles.items(), strict=True):
        for index, points in enumerate(labels):
            cell = table[(table.robot == robot) & (table.points == points) & (table.configuration_cost > 0)]
            cost, band = cell.configuration_cost, {"color": PALETTE[index], "alpha": 0.12, "linewidth": 0}
            axis.plot(cost, cell.ratio, **line_style(index), label=points)
            axis.fill_between(cost, cell.ratio_low, cell.ratio_high, **band)
        axis.set(title=title, xlabel="cost of a configuration (measurements)", xscale="log", yscale="log")
        axis.set_xticks([0.01, 0.1, 1, 10])
        axis.xaxis.set_major_formatter("{x:g}")
        label_decades(axis.yaxis)
    axes[0, 0].set_ylabel(f"cost of {accuracy_um:g} µm over that of {labels[0] if labels else ''}")
    title = "points measured in each configuration; bands: 95 % intervals by bootstrap over data sets"
    figure.legend(*axes[0, 0].get_legend_handles_labels(), title=title, loc="outside lower center", ncols=4)
    return figure


@styled
def designs(table: pd.DataFrame, titles: Mapping[str, str], accuracy_um: float, joint_range: str) -> Figure:
    """Error that random and optimal configurations leave, by their number.

    `table`: from `question_tables.designs_table`. `titles`: name of each robot to draw, by its key. `accuracy_um`: marked by a
    line. `joint_range`: whose rows are drawn.
    """
    table = table[table.joint_range == joint_range]
    figure, axes = panels(1, len(titles), 80, sharey=True)
    for axis, (robot, title) in zip(axes[0], titles.items(), strict=True):
        for index, (kind, name) in enumerate(_DESIGNS.items()):
            cell = table[(table.robot == robot) & (table.design == kind)]
            axis.plot(cell.configurations, cell.rms_um, **line_style(index), label=name)
            if kind == "random":
                axis.fill_between(cell.configurations, cell.low_um, cell.high_um, color=PALETTE[index], alpha=0.15, linewidth=0)
        axis.axhline(accuracy_um, color="black", linewidth=0.7)
        axis.set(title=title, xlabel="configurations", xscale="log", yscale="log")
        axis.set_xticks(sorted(set(table.configurations)), labels=[f"{size}" for size in sorted(set(table.configurations))])
        axis.xaxis.set_minor_locator(NullLocator())
        label_decades(axis.yaxis)
    axes[0, 0].set_ylabel("bound of the RMS error (µm)")
    title = f"band: 5 to 95 % of random designs; line: {accuracy_um:g} µm"
    figure.legend(*axes[0, 0].get_legend_handles_labels(), title=title, loc="outside lower center", ncols=5)
    return figure


@styled
def metrics(table: pd.DataFrame, titles: Mapping[str, str], names: Mapping[str, str]) -> Figure:
    """Scores of the strategies over those of the classical one, metric by metric.

    `table`: from `ranks.ranks_table`. `titles`: name of each robot to draw, by its key. `names`: what each metric is called.
    Returns one estimator under several names is drawn once, under the first of them.
    """
    figure, axes = panels(1, len(titles), 26 + 8 * len(names), sharey=True, sharex=True)
    for axis, (robot, title) in zip(axes[0], titles.items(), strict=True):
        mine = table[table.robot == robot]
        strategies = mine[mine.metric == next(iter(names))].drop_duplicates("value").strategy
        for index, strategy in enumerate(strategies):
            cells = mine[mine.strategy == strategy].set_index("metric").reindex([*names])
            rows = np.arange(len(names)) + 0.7 * ((index + 0.5) / len(strategies) - 0.5)
            spans = np.abs(cells[["ratio_low", "ratio_high"]].to_numpy() - cells[["ratio"]].to_numpy()).T
            axis.errorbar(cells.ratio, rows, xerr=spans, fmt="o", color=PALETTE[index], markersize=3.5, label=strategy)
        axis.axvline(1.0, color="black", linewidth=0.7)
        axis.set(title=title, xscale="log", yticks=range(len(names)), ylim=(len(names) - 0.5, -0.5))
        label_decades(axis.xaxis)
        axis.grid(visible=False, axis="y")
    axes[0, 0].set_yticklabels([name.replace("k_Σ", r"$k_\Sigma$") for name in names.values()])
    title = "score over that of the first strategy, 95 % intervals"
    figure.legend(*axes[0, 0].get_legend_handles_labels(), title=title, loc="outside lower center", ncols=5)
    return figure
