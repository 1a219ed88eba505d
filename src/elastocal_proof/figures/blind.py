"""Pictures of the blind proof: figures against targets, probabilities against
frequencies, power; and of the closed loop."""

from __future__ import annotations

import textwrap
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
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
from elastocal_proof.blind.cases import PROOF, TUNED
from elastocal_proof.blind.summary import iterate_rows, select_targets

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_COLOR = PALETTE[0]
_ROBOTS = {PROOF: "robots of the proof", TUNED: "robots on which it was developed"}
_AIM = "#cfe8d5"
_LINE = 40
_PER_CENT = 100.0
_FARTHEST = 10.0
_PANELS = {
    "oracle_detected": "the oracle\ndetects",
    "detected": "detected",
    "holds_truth": "right name, alone\nor in a class",
    "named_right": "right name alone",
}
# Never black, so that the numbers can be read everywhere.
_SHARES = LinearSegmentedColormap.from_list(
    "shares", ["#ffffff", "#c6dbef", "#4292c6", "#08519c"]
)
_LEAST_WRITTEN = 0.045
_ALL = "all"
_MODELS = {
    "uncorrected": "uncorrected",
    "geometry": "geometry alone",
    "declared": "geometry and springs",
    "found": "with the effects found",
    "true": "true model (floor)",
}
_PARTS = {"unloaded": "unloaded", "loaded": "under loads", "milling": "milling path"}


@styled
def draw_targets(summary: pd.DataFrame) -> Figure:
    """Every figure of summary.csv that has a target, with its interval and the range
    that the target leaves."""
    aimed = select_targets(summary)
    ratio = aimed.quantity.str.contains("over the oracle")
    names = [
        list(dict.fromkeys(part.quantity)) for part in (aimed[~ratio], aimed[ratio])
    ]
    # Shares of what the best analyst finds may exceed all of it.
    largest = max(
        102.0,
        1.05 * _PER_CENT * np.nanmax(aimed[~ratio].high.to_numpy(float), initial=0.0),
    )
    heights = [max(len(part), 1) for part in names]
    figure, axes = create_panels(2, 1, 32 + 7.4 * sum(heights), height_ratios=heights)
    _dots(axes[0, 0], aimed[~ratio], names[0], lambda value: _PER_CENT * value)
    axes[0, 0].set(
        xlim=(-2, largest),
        xlabel="share of cases, or of what the best analyst finds (%)",
    )
    _dots(axes[1, 0], aimed[ratio], names[1], lambda value: _PER_CENT * (value - 1.0))
    farthest = np.nanmax(
        np.abs(
            _PER_CENT * (aimed[ratio][["rate", "low", "high"]].to_numpy(float) - 1.0)
        ),
        initial=6.0,
    )
    axes[1, 0].set(
        xlim=(-1.1 * farthest, 1.1 * farthest),
        xlabel="held-out RMS above the oracle's (%)",
    )
    label = _ROBOTS[summary.robots.iloc[0]]
    handles: list[Artist] = [
        Line2D(
            [], [], color=_COLOR, marker="o", markersize=4.5, linewidth=1.2, label=label
        )
    ]
    handles.append(Patch(color=_AIM, label="target"))
    figure.legend(
        handles=handles,
        title="bars are 95 % intervals",
        title_fontsize=7.5,
        loc="outside lower center",
        ncols=3,
    )
    return figure


def _dots(
    axis: Axes, rows: pd.DataFrame, names: list[str], scaled: Callable[[float], float]
) -> None:
    for row in iterate_rows(rows):
        place = names.index(row.quantity)
        # A target without an upper end goes as far as anything is drawn.
        low = scaled(row.target_low)
        high = scaled(min(row.target_high, _FARTHEST))
        # A target of a single value is a line that can be seen.
        axis.barh(
            place,
            max(high - low, 0.8),
            left=low - (0.4 if high == low else 0.0),
            height=0.86,
            color=_AIM,
            zorder=0,
        )
        if not np.isfinite(row.rate):
            # The interval of nothing is everything, which would look like a result.
            at = "axes fraction", "data"
            axis.annotate(
                "no cases",
                (0.01, place),
                xycoords=at,
                va="center",
                color=_COLOR,
                fontsize=7,
            )
            continue
        axis.plot(
            [scaled(row.low), scaled(row.high)],
            [place, place],
            color=_COLOR,
            linewidth=1.2,
        )
        axis.plot(scaled(row.rate), place, "o", color=_COLOR, markersize=4.2)
    axis.set(yticks=range(len(names)), ylim=(len(names) - 0.4, -0.6))
    axis.set_yticklabels([textwrap.fill(name, _LINE) for name in names], fontsize=7)
    axis.grid(visible=False, axis="y")
    axis.set_axisbelow(True)


@styled
def draw_reliability(reliability: pd.DataFrame) -> Figure:
    """Shares of cases whose most probable set of mechanisms is true, against what was
    stated, and numbers of cases."""
    rows = reliability[reliability.group == _ALL]
    if rows.empty:
        return draw_note("No verdict of this run states a probability.")
    figure, axes = create_panels(2, 1, 118, height_ratios=(3, 1), sharex=True)
    shares = axes[0, 0]
    counts = axes[1, 0]
    shares.plot([0, 1], [0, 1], color="black", linewidth=0.8, linestyle=":")
    errors = [rows.rate - rows.low, rows.high - rows.rate]
    width = rows["to"] - rows["from"]
    shares.errorbar(
        rows.stated,
        rows.rate,
        errors,
        color=_COLOR,
        marker="o",
        markersize=4.5,
        linewidth=1.2,
    )
    counts.bar(
        rows["from"] + 0.1 * width, rows.cases, 0.8 * width, align="edge", color=_COLOR
    )
    shares.set(xlim=(0, 1), ylim=(0, 1), ylabel="share of cases in which it is true")
    counts.set(
        yscale="log",
        xlabel="stated probability of the most probable mechanisms",
        ylabel="cases",
    )
    return figure


@styled
def draw_power(rates: pd.DataFrame) -> Figure:
    """Shares of rates.csv detected and named for each effect and size, beside the
    oracle that knows the effect."""
    single = rates[rates.group == "single"]
    if single.empty:
        return draw_note("This run has no case with one effect.")
    table = single.set_index(["truth", "level"])
    levels = sorted(single.level.unique())
    at_largest = single[single.level == max(levels)].set_index("truth")["named_right"]
    effects = sorted(
        (name for name in at_largest.index if name != _ALL),
        key=lambda name: (-at_largest[name], name),
    )
    effects += [_ALL] * (_ALL in set(single.truth))
    figure, axes = create_panels(1, len(_PANELS), 34 + 4.6 * len(effects), sharey=True)
    for axis, (column, title) in zip(axes[0], _PANELS.items(), strict=True):
        shares = (
            table[column]
            .reindex(pd.MultiIndex.from_product([effects, levels]))
            .to_numpy(float)
        )
        _heat(axis, shares.reshape(len(effects), len(levels)))
        axis.set(
            xticks=range(len(levels)),
            yticks=range(len(effects)),
            title=title,
            xlabel="non-centrality",
        )
        axis.set_xticklabels([f"{level:g}" for level in levels])
        if _ALL in effects:
            axis.axhline(len(effects) - 1.5, color="black", linewidth=0.8)
    raw = set(single[single.level_of == "raw"].truth)
    known = {_ALL: "all effects"}
    labels = [
        known.get(name, name.replace("_", " ")) + (" *" if name in raw else "")
        for name in effects
    ]
    axes[0, 0].set_yticklabels(labels, fontsize=7)
    words = "Numbers are shares of cases in %."
    if raw:
        words += "\n* Wholly absorbed by the joint compliances: the size is that before absorption; not among all effects."
    figure.supxlabel(words, fontsize=7)
    return figure


def _heat(axis: Axes, shares: np.ndarray) -> None:
    axis.imshow(
        np.ma.masked_invalid(shares),
        cmap=_SHARES,
        vmin=0,
        vmax=1,
        interpolation="nearest",
        aspect="auto",
    )
    for row, column in np.argwhere(np.nan_to_num(shares) >= _LEAST_WRITTEN):
        ink = choose_ink(_SHARES(shares[row, column]))
        text = f"{_PER_CENT * shares[row, column]:.0f}"
        axis.text(column, row, text, ha="center", va="center", fontsize=6.5, color=ink)
    axis.tick_params(length=0)
    axis.grid(visible=False)
    axis.spines[:].set_visible(False)


def draw_blind(job: Any) -> None:
    """All pictures of the proof, by their names."""
    for name, draw, table in (
        ("targets", draw_targets, "summary"),
        ("reliability", draw_reliability, "reliability"),
        ("power", draw_power, "rates"),
    ):
        figure = draw(pd.read_csv(job.input[table]))
        save(
            figure,
            job.output[f"{name}_pdf"],
            job.output[name],
            Origin(**job.config["origin"]),
        )


@styled
def draw_correction_errors(table: pd.DataFrame, names: Mapping[str, str]) -> Figure:
    """What a robot misses after its targets were corrected, by part and by the model
    that corrected them.

    `names`: of the robots, by those of their files.
    """
    robots = [robot for robot in dict.fromkeys(table["robot"]) if robot != "all"]
    figure, axes = create_panels(1, len(_PARTS), 62, sharey=True, sharex=True)
    for axis, (part, words) in zip(axes[0], _PARTS.items(), strict=True):
        for number, robot in enumerate(robots):
            mine = (
                table[(table["part"] == part) & (table["robot"] == robot)]
                .set_index("model")
                .loc[list(_MODELS)]
            )
            place = np.arange(len(_MODELS))[::-1] + 0.22 * (
                0.5 * (len(robots) - 1) - number
            )
            limits = np.abs(
                mine[["rms_mm_low", "rms_mm_high"]].to_numpy().T
                - mine["rms_mm"].to_numpy()
            )
            axis.errorbar(
                mine["rms_mm"],
                place,
                xerr=limits,
                fmt="o",
                ms=3.5,
                lw=1.2,
                color=PALETTE[number],
                label=names[robot],
            )
        axis.set_xscale("log")
        axis.xaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
        axis.set_title(words)
        axis.set_xlabel("position error, RMS (mm)")
    axes[0, 0].set_yticks(np.arange(len(_MODELS))[::-1], list(_MODELS.values()))
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(
        handles, labels, loc="outside lower center", ncols=max(len(robots), 1)
    )
    return figure


def draw_closed_loop(job: Any) -> None:
    """The picture, from reports/closed_loop/closed_loop.csv."""
    names = {Path(path).stem: read_robot(Path(path)).name for path in job.input.robots}
    figure = draw_correction_errors(pd.read_csv(job.input.summary), names)
    save(figure, job.output.figure, job.output.picture, Origin(**job.config["origin"]))
