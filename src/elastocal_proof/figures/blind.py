"""Draw the figures of the blind benchmark and of the closed loop: rates against their
targets, stated probabilities against frequencies, power, and errors after correction."""

from __future__ import annotations

import textwrap
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Rectangle
from matplotlib.ticker import StrMethodFormatter

from elastocal.campaigns.reading import read_robot
from elastocal.figures.style import (
    PALETTE,
    choose_ink,
    create_panels,
    draw_note,
    save,
    styled,
)
from elastocal.io.origin import Origin
from elastocal.report.words import name_effect
from elastocal_proof.blind.cases import PROOF, TUNED
from elastocal_proof.blind.summary import iterate_rows, select_targets

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_COLOR = PALETTE[0]
_TARGET_COLOR = "#cfe8d5"
_ROBOTS = {
    PROOF: "robots on which nothing was developed",
    TUNED: "robots on which elastocal was developed",
}
_PER_CENT = 100.0
# Number of letters after which a label of a row is wrapped.
_LABEL_WIDTH = 40
# End of the drawn range of a target without an upper bound.
_MAX_TARGET = 10.0
# Smallest drawn width of a target's range, so that a single value can be seen.
_MIN_TARGET_WIDTH = 0.8
_PANELS = {
    "oracle_detected": "the oracle\ndetects",
    "detected": "detected",
    "holds_truth": "among the\nstated",
    "named_right": "stated\nalone",
    "located": "with its\njoints",
}
# Never black, so that the numbers are legible everywhere.
_SHARE_COLORS = LinearSegmentedColormap.from_list(
    "shares", ["#ffffff", "#c6dbef", "#4292c6", "#08519c"]
)
# Hatching of cells without a case, in the colour of its lines.
_NO_CASE: dict[str, Any] = {
    "facecolor": "white",
    "edgecolor": "#b0b0b0",
    "hatch": "////",
}
# Name of all effects, groups or robots together.
_ALL = "all"
# Cases of a bin below which its share says nothing: the 95 % interval is wider than half.
_LEAST_CASES = 10
# Groups of the reliability diagram: label, colour and marker.
_ALARMS = {
    "alarm": ("after an alarm: the mechanisms stated", PALETTE[0], "o"),
    "no alarm": ("without an alarm: nothing is missing", PALETTE[1], "s"),
}
# Height of a figure without robots, and of the marks of one robot, mm.
_AXIS_HEIGHT = 20.0
_ROBOT_HEIGHT = 14.0
# More names of robots beside each other do not fit into the width of a page.
_LEGEND_COLUMNS = 2
_MODELS = {
    "uncorrected": "uncorrected",
    "geometry": "geometry",
    "declared": "geometry and compliances",
    "found": "with the effects found",
    "true": "true model (repeatability)",
}
_PARTS = {"unloaded": "unloaded", "loaded": "under load", "milling": "milling path"}
# Vertical distance between the marks of two robots, in rows.
_MARK_DISTANCE = 0.22


@styled
def draw_targets(summary: pd.DataFrame) -> Figure:
    """Draw every quantity of summary.csv that has a target, with its interval and the
    range of the target."""
    targets = select_targets(summary)
    is_ratio = targets.quantity.str.contains("over the oracle")
    shares = targets[~is_ratio]
    ratios = targets[is_ratio]
    heights = [max(table.quantity.nunique(), 1) for table in (shares, ratios)]
    figure, axes = create_panels(2, 1, 32 + 7.4 * sum(heights), height_ratios=heights)
    _draw_intervals(axes[0, 0], shares, lambda share: _PER_CENT * share)
    axes[0, 0].set(xlim=(-2, 102), xlabel="share (%)")
    _draw_intervals(axes[1, 0], ratios, lambda ratio: _PER_CENT * (ratio - 1.0))
    excess = _PER_CENT * (ratios[["rate", "low", "high"]].to_numpy(float) - 1.0)
    limit = 1.1 * np.nanmax(np.abs(excess), initial=6.0)
    axes[1, 0].set(xlim=(-limit, limit), xlabel="held-out RMS above the oracle's (%)")
    interval = Line2D(
        [],
        [],
        color=_COLOR,
        marker="o",
        markersize=4.5,
        linewidth=1.2,
        label=_ROBOTS[summary.robots.iloc[0]],
    )
    figure.legend(
        handles=[interval, Patch(color=_TARGET_COLOR, label="target")],
        title="bars are 95 % intervals",
        title_fontsize=7.5,
        loc="outside lower center",
        ncols=3,
    )
    return figure


def _draw_intervals(
    axis: Axes, table: pd.DataFrame, scale: Callable[[float], float]
) -> None:
    """Draw rates with their intervals, a row for each quantity."""
    names = list(dict.fromkeys(table.quantity))
    for row in iterate_rows(table):
        height = names.index(row.quantity)
        low = scale(row.target_low)
        high = scale(min(row.target_high, _MAX_TARGET))
        axis.barh(
            height,
            max(high - low, _MIN_TARGET_WIDTH),
            left=low - (0.5 * _MIN_TARGET_WIDTH if high == low else 0.0),
            height=0.86,
            color=_TARGET_COLOR,
            zorder=0,
        )
        if not np.isfinite(row.rate):
            # Without cases the interval holds every value, which would look like a
            # result.
            axis.annotate(
                "no cases",
                (0.01, height),
                xycoords=("axes fraction", "data"),
                va="center",
                color=_COLOR,
                fontsize=7,
            )
            continue
        interval = [scale(row.low), scale(row.high)]
        axis.plot(interval, [height, height], color=_COLOR, linewidth=1.2)
        axis.plot(scale(row.rate), height, "o", color=_COLOR, markersize=4.2)
    axis.set(yticks=range(len(names)), ylim=(len(names) - 0.4, -0.6))
    labels = [textwrap.fill(name, _LABEL_WIDTH) for name in names]
    axis.set_yticklabels(labels, fontsize=7)
    axis.grid(visible=False, axis="y")
    axis.set_axisbelow(True)


@styled
def draw_reliability(reliability: pd.DataFrame) -> Figure:
    """Draw how often the most probable set of mechanisms is true against its stated
    probability, with an alarm and without one, and the numbers of cases of all bins."""
    if reliability.empty:
        return draw_note("No verdict of this run states a probability.")
    figure, axes = create_panels(2, 1, 118, height_ratios=(3, 1), sharex=True)
    shares = axes[0, 0]
    counts = axes[1, 0]
    shares.plot(
        [0, 1], [0, 1], color="black", linewidth=0.8, linestyle=":", label="ideal"
    )
    for number, (group, (label, color, marker)) in enumerate(_ALARMS.items()):
        rows = reliability[reliability.group == group]
        drawn = rows[rows.cases >= _LEAST_CASES]
        shares.errorbar(
            drawn.stated,
            drawn.rate,
            [drawn.rate - drawn.low, drawn.high - drawn.rate],
            color=color,
            marker=marker,
            markersize=4.5,
            linewidth=1.2,
            label=label,
        )
        width = rows["to"] - rows["from"]
        left = rows["from"] + (0.1 + 0.4 * number) * width
        counts.bar(left, rows.cases, 0.4 * width, align="edge", color=color)
    shares.legend(loc="lower right")
    shares.set(xlim=(0, 1), ylim=(0, 1), ylabel="share of cases in which it is true")
    counts.set(
        yscale="log",
        xlabel="stated probability of the most probable mechanisms, or of none",
        ylabel="cases",
    )
    return figure


@styled
def draw_power(rates: pd.DataFrame) -> Figure:
    """Draw the shares of rates.csv that are detected and named, for each effect and
    size, and those of the oracle, which knows the effect."""
    single = rates[rates.group == "single"]
    if single.empty:
        return draw_note("This run has no case with one effect.")
    levels = sorted(single.level.unique())
    largest = single[(single.level == max(levels)) & (single.truth != _ALL)]
    # The effects that are named most often come first, all effects together last.
    effects = largest.sort_values(["named_right", "truth"], ascending=[False, True])[
        "truth"
    ].tolist()
    if _ALL in set(single.truth):
        effects.append(_ALL)
    cells = pd.MultiIndex.from_product([effects, levels])
    table = single.set_index(["truth", "level"]).reindex(cells)
    figure, axes = create_panels(1, len(_PANELS), 34 + 4.6 * len(effects), sharey=True)
    for axis, (column, title) in zip(axes[0], _PANELS.items(), strict=True):
        shares = table[column].to_numpy(float)
        _draw_cells(axis, shares.reshape(len(effects), len(levels)))
        axis.set(
            xticks=range(len(levels)),
            yticks=range(len(effects)),
            title=title,
        )
        axis.set_xticklabels([f"{level:g}" for level in levels])
        if _ALL in effects:
            axis.axhline(len(effects) - 1.5, color="black", linewidth=0.8)
    absorbed = set(single[single.level_of == "raw"].truth)
    axes[0, 0].set_yticklabels(
        [_label_effect(name, absorbed) for name in effects], fontsize=7
    )
    caption = (
        "Shares of cases in % by the non-centrality of the true mechanism; hatched: no"
        " case."
    )
    if absorbed:
        caption += (
            "\n* Wholly absorbed by the joint compliances: the size is that before"
            " absorption; not among all effects."
        )
    figure.supxlabel(caption, fontsize=7)
    return figure


def _label_effect(name: str, absorbed: set[str]) -> str:
    label = "all effects" if name == _ALL else name_effect(name)
    return f"{label} *" if name in absorbed else label


def _draw_cells(axis: Axes, shares: np.ndarray) -> None:
    """Draw a heat map with the shares, in per cent, in its cells."""
    axis.imshow(
        np.ma.masked_invalid(shares),
        cmap=_SHARE_COLORS,
        vmin=0,
        vmax=1,
        interpolation="nearest",
        aspect="auto",
    )
    for row, column in np.argwhere(np.isnan(shares)):
        corner = (column - 0.5, row - 0.5)
        axis.add_patch(Rectangle(corner, 1.0, 1.0, linewidth=0.0, **_NO_CASE))
    for row, column in np.argwhere(np.isfinite(shares)):
        share = shares[row, column]
        axis.text(
            column,
            row,
            f"{_PER_CENT * share:.0f}",
            ha="center",
            va="center",
            fontsize=6.5,
            color=choose_ink(_SHARE_COLORS(share)),
        )
    axis.tick_params(length=0)
    axis.grid(visible=False)
    axis.spines[:].set_visible(False)


def draw_blind(job: Any) -> None:
    """Draw all figures of the blind benchmark."""
    for name, draw, table in (
        ("targets", draw_targets, "summary"),
        ("reliability", draw_reliability, "reliability"),
        ("power", draw_power, "rates"),
    ):
        figure = draw(pd.read_csv(job.input[table]))
        origin = Origin(**job.config["origin"])
        save(figure, job.output[f"{name}_pdf"], job.output[name], origin)


@styled
def draw_correction_errors(table: pd.DataFrame, names: Mapping[str, str]) -> Figure:
    """Draw the errors of robots after their targets were corrected, without the noise
    of the tracker, which would hide the differences.

    Each test has a panel, and each correcting model a row.

    Parameters
    ----------
    table
        Errors by robot, test (column ``part``) and model.
    names
        Names of the robots by those of their files.
    """
    robots = [robot for robot in dict.fromkeys(table["robot"]) if robot != _ALL]
    heights = np.arange(len(_MODELS))[::-1]
    height = _AXIS_HEIGHT + _ROBOT_HEIGHT * len(robots)
    figure, axes = create_panels(1, len(_PARTS), height, sharey=True, sharex=True)
    for axis, (test, title) in zip(axes[0], _PARTS.items(), strict=True):
        for number, robot in enumerate(robots):
            chosen = (table["part"] == test) & (table["robot"] == robot)
            rows = table[chosen].set_index("model").loc[list(_MODELS)]
            rms = rows["reached_mm"].to_numpy()
            limits = rows[["reached_mm_low", "reached_mm_high"]].to_numpy().T
            offset = _MARK_DISTANCE * (0.5 * (len(robots) - 1) - number)
            axis.errorbar(
                rms,
                heights + offset,
                xerr=np.abs(limits - rms),
                fmt="o",
                ms=3.5,
                lw=1.2,
                color=PALETTE[number],
                label=names[robot],
            )
        axis.set_xscale("log")
        axis.xaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
        axis.set_title(title)
        axis.set_xlabel("RMS position error (mm)")
    axes[0, 0].set_yticks(heights, list(_MODELS.values()))
    figure.legend(
        *axes[0, 0].get_legend_handles_labels(),
        title="without the tracker's noise; bars are 95 % intervals",
        title_fontsize=7.5,
        loc="outside lower center",
        ncols=_LEGEND_COLUMNS,
    )
    return figure


def draw_closed_loop(job: Any) -> None:
    """Draw the figure from reports/closed_loop/closed_loop.csv."""
    names = {Path(path).stem: read_robot(Path(path)).name for path in job.input.robots}
    figure = draw_correction_errors(pd.read_csv(job.input.summary), names)
    save(figure, job.output.figure, job.output.picture, Origin(**job.config["origin"]))
