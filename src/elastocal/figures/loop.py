"""Figures of a campaign: errors as arrows and model by model, hypotheses and candidates
one by one, what each effect costs."""

import textwrap
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from elastocal.counting import format_count, list_first
from elastocal.figures.style import (
    MILLI,
    PALETTE,
    STAGES,
    add_legend_below,
    create_panels,
    draw_note,
    label_decades,
    styled,
)
from elastocal.report.words import (
    candidate_words,
    capital,
    hypotheses_words,
    in_words,
    probability_words,
    unit_of,
)

# Of more states than this only one is drawn in each cell of a grid of so many columns.
_MOST_ARROWS = 320
_CELLS = 18
# Length of the arrow of a large residual, as a share of the workspace.
_ARROW = 0.13

METRICS = {"mean": "mean", "rms": "RMS", "p95": "95th percentile", "max": "maximum"}
MODEL_STYLES = {
    "frames": ("#b9b9b9", "frames and targets only"),
    "declared": STAGES["before"][::-1],
    "effect": STAGES["after"][::-1],
    "kept": ("#777777", "frames and targets only, kept"),
}
# Beyond this ratio the smallest bars would be lost on a linear axis.
_LARGEST_RATIO = 25
_LINE = 26
_NAMES = 3
_DIAMOND: dict[str, Any] = {
    "linestyle": "",
    "marker": "D",
    "color": "white",
    "markeredgecolor": "black",
    "markersize": 3.4,
}
FAMILY_COLOURS = dict(
    zip(
        ("geometry", "gravity", "transmission", "elastic", "gearbox", "load", "drift"),
        PALETTE,
        strict=False,
    )
)
# Hypotheses and candidates with a bar of their own.
_HYPOTHESES = 8
_NAMED = 15
_ALL_ELSE = "Everything else"
# Letters in a line of a label, and in the longest label.
_LABEL = 44
_LONGEST = 80
# Height of a row of one line, and of each further line.
_ROW_MM = 4.6
_LINE_MM = 3.0
# Why nothing is tested where the data are at fault, as tables.candidate_rows notes it.
_AT_FAULT = "the measurements are at fault"
# What is left however well the robot is corrected.
_REST = (
    "uncertainty of the parameters",
    "repeatability",
    "form of the model",
    "not commanded",
    "left by the regression",
)
TRACKER = "tracker"
_SHARES = {
    "uncorrected": ("#b9b9b9", "without any correction"),
    "effect": (PALETTE[0], "if this alone were left out"),
    "rest": (PALETTE[2], "left after correction"),
    TRACKER: ("#ffffff", "in no robot: noise of a single measurement"),
}


@styled
def draw_residual_arrows(
    table: Mapping[str, np.ndarray], arm: np.ndarray | None = None
) -> Figure:
    """Residuals as arrows where the measurements were taken, from the side and from
    above.

    `table`: columns of the residuals table. `arm` (K, 3): corners of the robot in one
    pose, m. Repeats are averaged; where states are still many, one of each cell of a
    grid is drawn.
    """
    place, off = _states(table)
    # The first alone where nothing was found that changes a residual.
    stages = tuple(STAGES)[
        : 1 if np.allclose(off["before"], off["after"], rtol=0, atol=1e-9) else 2
    ]
    size = np.linalg.norm(off["before"], axis=1)
    largest = max(np.quantile(size, 0.95), 1e-9)
    extent = np.maximum(np.ptp(place, axis=0), 1e-3)
    # One digit: the side of a cell is a number that can be quoted.
    digit = 10.0 ** np.floor(np.log10(extent.max() / _CELLS))
    cell_m = (
        float(np.ceil(extent.max() / _CELLS / digit) * digit)
        if len(place) > _MOST_ARROWS
        else None
    )
    views = {"from the side": (0, 2), "from above": (0, 1)}
    figure, axes = create_panels(
        1, 2, 26 + float(np.clip(66 * extent[1:].max() / extent[0], 40, 56))
    )
    length = _ARROW * extent.max()
    for axis, (title, seen) in zip(axes[0], views.items(), strict=True):
        shown = (
            np.arange(len(place))
            if cell_m is None
            else select_median_states(place[:, seen], size, cell_m)
        )
        at = place[shown][:, seen]
        for order, stage in enumerate(stages):
            tips = at + off[stage][shown][:, seen] * length / largest
            head = {
                "width": 0.006 - 0.0025 * order,
                "headwidth": 3.2,
                "headlength": 4,
                "headaxislength": 3.6,
                "minlength": 0.3,
            }
            arrow = axis.quiver(
                *at.T,
                *(tips - at).T,
                angles="xy",
                scale_units="xy",
                scale=1,
                color=STAGES[stage][1],
                **head,
            )
            arrow.set(zorder=3 + order, gid=stage)
            axis.update_datalim(tips)
        if arm is not None:
            ends: dict[str, Any] = {
                "solid_capstyle": "round",
                "solid_joinstyle": "round",
                "gid": "arm",
            }
            axis.plot(*arm[:, seen].T, color="#c8c8c8", linewidth=6, zorder=1, **ends)
        axis.plot(0, 0, "+", color="black", markersize=8, gid="base")
        axis.annotate("base", (0, 0), (4, 4), textcoords="offset points", fontsize=7)
        axis.set_title(title, loc="left")
        axis.set(xlabel="x (m)", ylabel=f"{'xyz'[seen[1]]} (m)", aspect="equal")
        axis.margins(0.06)
        axis.set_anchor("N")
        axis.set_axisbelow(True)
    _scale_arrow(axes[0, 1], largest, length)
    of_cells = f"one state of each cell of {1e3 * (cell_m or 0.0):g} mm, that of the middle residual"
    which = of_cells if cell_m else "each arrow: mean of the repeats"
    handles = [
        Line2D([], [], color=STAGES[stage][1], linewidth=2, label=STAGES[stage][0])
        for stage in stages
    ]
    figure.legend(handles=handles, title=which, loc="outside lower center", ncols=2)
    return figure


def select_median_states(at: np.ndarray, size: np.ndarray, side: float) -> np.ndarray:
    """The state of middle size in each cell of a grid.

    `at` (N, 2): m. `size` (N,). `side`: m. Returns (cells,) of int: one for each cell
    that is not empty.
    """
    _, cell = np.unique(np.floor(at / side).astype(int), axis=0, return_inverse=True)
    order = np.lexsort((size, cell.ravel()))
    counts = np.bincount(cell.ravel())
    return order[np.cumsum(counts) - counts + (counts - 1) // 2]


def _states(
    table: Mapping[str, np.ndarray],
) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Mean place and residuals of each state and target."""
    keys = ["held_out", "session", "pose", "load", "target"]
    seen = [*"xyz", *(f"{stage}_d{axis}" for stage in STAGES for axis in "xyz")]
    means = (
        pd.DataFrame({name: table[name] for name in keys + seen})
        .groupby(keys, dropna=False, observed=True)
        .mean()
    )
    off = {
        stage: means[[f"{stage}_d{axis}" for axis in "xyz"]].to_numpy()
        for stage in STAGES
    }
    return means[[*"xyz"]].to_numpy(), off


def _scale_arrow(axis: Axes, largest: float, length: float) -> None:
    """An arrow of a round length beside the title."""
    digit = 10.0 ** np.floor(np.log10(largest))
    shown = (
        max(step for step in (1, 2, 5) if step * digit <= largest * (1 + 1e-9)) * digit
    )
    scale, unit = unit_of(shown)
    key = axis.quiver(
        [0],
        [0],
        [0],
        [0],
        angles="xy",
        scale_units="xy",
        scale=1,
        color="black",
        width=0.006,
        minlength=0,
    )
    place = {"labelpos": "W", "coordinates": "axes", "fontproperties": {"size": 8}}
    axis.quiverkey(
        key, 0.88, 1.035, shown * length / largest, f"{scale * shown:g} {unit}", **place
    )
    key.set_visible(False)


@styled
def draw_before_after(
    steps: Sequence[Mapping[str, Any]], noise_floor_m: float | None = None
) -> Figure:
    """Bars of the errors on held-out poses, one for each model.

    `steps`: rows of before_after.csv. `noise_floor_m`: RMS error that the noise alone
    leaves.
    """
    # Words, with the ends of long lists left out, in lines that fit beside the bars.
    labels = [
        textwrap.fill(list_first(in_words(step["step"]).split(", "), _NAMES), _LINE)
        for step in steps
    ]
    lines = [label.count("\n") + 1 for label in labels]
    figure, axes = create_panels(
        1, len(METRICS), 30 + 4.0 * sum(lines) + 4.5 * len(steps), sharey=True
    )
    # Rows as high as their names are long.
    heights = np.array([0.55 + 0.45 * count for count in lines])
    rows = np.cumsum(heights) - heights / 2
    values = np.array(
        [[step[f"heldout_{metric}_m"] for metric in METRICS] for step in steps]
    )
    scale, unit = unit_of(values.max())
    trained = np.array(
        [[step[f"train_{metric}_m"] for metric in METRICS] for step in steps]
    )
    known = [*values[values > 0], *([noise_floor_m] if noise_floor_m else [])]
    logarithmic = max(known) > _LARGEST_RATIO * min(known)
    for axis, (metric, title) in zip(axes[0], METRICS.items(), strict=True):
        for row, step in zip(rows, steps, strict=True):
            value, low, high = (
                scale * step[f"heldout_{metric}_m{end}"]
                for end in ("", "_low", "_high")
            )
            axis.barh(row, value, height=0.42, color=MODEL_STYLES[step["kind"]][0])
            axis.plot(
                [low, high], [row, row], color="black", linewidth=1.1, gid="interval"
            )
            axis.plot(scale * step[f"train_{metric}_m"], row, **_DIAMOND)
        if noise_floor_m:
            axis.axvline(
                scale * noise_floor_m,
                color="black",
                linestyle=":",
                linewidth=1.2,
                gid="noise floor",
            )
        axis.set(title=title, xlabel=f"error ({unit})")
        if logarithmic:
            axis.set(
                xscale="log",
                xlim=(
                    0.5 * scale * min(known),
                    1.6 * scale * max(values.max(), trained.max()),
                ),
            )
            axis.xaxis.set_major_formatter("{x:g}")
        else:
            axis.set_xlim(0, None)
        axis.grid(visible=False, axis="y")
        axis.set_axisbelow(True)
    axes[0, 0].set(yticks=rows, ylim=(heights.sum(), 0))
    axes[0, 0].set_yticklabels(labels, fontsize=7.5)
    kinds = {step["kind"] for step in steps}
    handles: list[Artist] = [
        Patch(color=color, label=label)
        for kind, (color, label) in MODEL_STYLES.items()
        if kind in kinds
    ]
    handles.append(
        Line2D([], [], color="black", linewidth=1.1, label="95 % interval over poses")
    )
    handles.append(Line2D([], [], **_DIAMOND, label="on fitted poses"))
    if noise_floor_m:
        handles.append(
            Line2D(
                [],
                [],
                color="black",
                linestyle=":",
                linewidth=1.2,
                label="RMS that noise alone leaves",
            )
        )
    figure.legend(handles=handles, loc="outside lower center", ncols=3)
    return figure


@styled
def draw_errors_by_campaign(table: pd.DataFrame) -> Figure:
    """Root mean square errors with their intervals, a line for each campaign.

    `table`: ``campaign``, ``poses``, and ``before_rms_mm``, ``before_rms_low_mm``,
    ``before_rms_high_mm``, the same for after: mm.
    """
    rows = np.arange(len(table))[::-1]
    figure, axes = create_panels(1, 1, 24 + 6 * len(table))
    axis = axes[0, 0]
    axis.hlines(
        rows,
        table["after_rms_mm"],
        table["before_rms_mm"],
        color="#c8c8c8",
        lw=2.5,
        zorder=1,
    )
    for stage, (words, color) in STAGES.items():
        rms, low, high = (
            table[f"{stage}_rms{end}_mm"].to_numpy(float)
            for end in ("", "_low", "_high")
        )
        # An interval that is open above is drawn to the value alone.
        span = [rms - low, np.where(np.isfinite(high), high - rms, 0.0)]
        axis.errorbar(
            rms,
            rows,
            xerr=span,
            fmt="o",
            color=color,
            ms=4,
            lw=1.2,
            capsize=2,
            label=words,
            zorder=2,
        )
    # Robots and series in capitals, as people write them.
    names = table["campaign"].str.replace("_on_", ", judged on ").str.replace("_", " ")
    names = names.str.replace(r"^\w+|\b\w\b", lambda word: word[0].upper(), regex=True)
    # A campaign with two sessions has two lines.
    names = names.where(
        ~names.duplicated(keep=False),
        names + ", " + table["poses"].map(lambda count: format_count(count, "pose")),
    )
    axis.set_yticks(rows, names)
    axis.set(
        xscale="log",
        xlabel="RMS position error of held-out poses (mm), with 95 % intervals",
    )
    label_decades(axis.xaxis)
    axis.grid(visible=False, axis="y")
    add_legend_below(figure, 2)
    return figure


@styled
def draw_probabilities(
    stated: Mapping[str, Any] | None, table: Mapping[str, np.ndarray]
) -> Figure:
    """Posterior probabilities of the leading hypotheses, and Bayes factors of the
    leading candidates alone.

    `stated`: ``probabilities`` of a diagnosis; None where the data are at fault.
    `table`: columns of the candidates table.
    """
    order = rank_candidates(table)
    if stated is None or not len(order):
        count = len(set(table["candidate"]))
        faulty = count and set(table["note"]) == {_AT_FAULT}
        nothing = (
            f"None of {count} candidate causes can be tested with these measurements."
        )
        return draw_note(
            "The data are at fault: no cause in the robot was looked for."
            if faulty
            else nothing
        )
    sets = stated["sets"][:_HYPOTHESES]
    named = order[:_NAMED]
    labels = [textwrap.fill(capital(words), _LABEL) for words in hypotheses_words(sets)]
    values = [entry["probability"] for entry in sets]
    if (rest := 1.0 - sum(values)) > 0.001:
        labels = [*labels, _ALL_ELSE]
        values = [*values, rest]
    names = [shorten_candidate_name(table["candidate"][index]) for index in named]
    upper = _heights_mm(labels)
    lower = _heights_mm(names)
    sizes = [34 + upper.sum(), 22 + lower.sum()]
    figure, axes = create_panels(2, 1, sum(sizes), height_ratios=sizes)
    colours = [PALETTE[0] if label != _ALL_ELSE else "#d9d9d9" for label in labels]
    rows = _label_rows(axes[0, 0], labels, upper)
    axes[0, 0].barh(
        rows, 100 * np.array(values), height=0.62 * upper, color=colours, zorder=2
    )
    for row, value in zip(rows, values, strict=True):
        place = {
            "xytext": (3, 0),
            "textcoords": "offset points",
            "va": "center",
            "fontsize": 7.5,
        }
        axes[0, 0].annotate(probability_words(value), (100 * value, row), **place)
    axes[0, 0].set(
        xlim=(0, 112), xticks=range(0, 101, 20), xlabel="posterior probability (%)"
    )
    axes[0, 0].set_title("What is missing in the declared model", loc="left")
    _factors(axes[1, 0], table, named, _label_rows(axes[1, 0], names, lower))
    present = [
        family for family in FAMILY_COLOURS if family in set(table["family"][named])
    ]
    handles = [Patch(color=FAMILY_COLOURS[family], label=family) for family in present]
    if table["chosen"].any():
        handles.append(
            Patch(
                facecolor="none",
                edgecolor="black",
                linewidth=1.3,
                label="in the most probable model",
            )
        )
    untestable = len(set(table["candidate"])) - len(order)
    words = f"{len(order)} candidate causes tested; {untestable} more cannot be tested with these measurements"
    figure.legend(handles=handles, title=words, loc="outside lower center", ncols=4)
    return figure


def _factors(
    axis: Axes, table: Mapping[str, np.ndarray], named: np.ndarray, rows: np.ndarray
) -> None:
    """Bayes factors of single candidates, coloured by family."""
    factors = table["log_bayes_factor"][named]
    chosen = table["chosen"][named].astype(bool)
    colours = [
        FAMILY_COLOURS.get(family, PALETTE[-1]) for family in table["family"][named]
    ]
    axis.barh(rows, factors, color=colours, height=2.6, zorder=2)
    if chosen.any():
        style: dict[str, Any] = {
            "facecolor": "none",
            "edgecolor": "black",
            "linewidth": 1.3,
            "zorder": 3,
            "gid": "chosen",
        }
        axis.barh(rows[chosen], factors[chosen], height=2.6, **style)
    # Roots keep the small ones in sight; symmetric, since a factor may be below zero.
    axis.set_xscale(
        "function",
        functions=(
            lambda x: np.sign(x) * np.sqrt(np.abs(x)),
            lambda x: np.sign(x) * np.square(x),
        ),
    )
    low = min(factors.min(), 0.0)
    high = max(factors.max(), 2.0)
    # Squares of evenly spaced roots.
    ends = np.linspace(-np.sqrt(-low), np.sqrt(high), 7)
    ticks = {float(f"{root * abs(root):.2g}") for root in ends} | {0.0}
    axis.set(
        xlim=(1.08 * low, 1.06 * high),
        xticks=sorted(tick for tick in ticks if low <= tick <= high),
    )
    axis.xaxis.set_major_formatter("{x:g}")
    axis.set_xlabel(
        "Bayes factor against the declared model\n(natural logarithm; above 0 it explains more)"
    )
    axis.axvline(0, color="black", linewidth=0.8, zorder=4)
    axis.set_title("Each candidate cause alone", loc="left")


def _heights_mm(labels: Sequence[str]) -> np.ndarray:
    """Heights of rows in which labels of one or more lines fit."""
    return np.array([_ROW_MM + _LINE_MM * label.count("\n") for label in labels])


def _label_rows(
    axis: Axes, labels: Sequence[str], heights_mm: np.ndarray
) -> np.ndarray:
    """Label rows from above, in an axis whose unit is a millimetre; returns their
    middles."""
    rows = np.cumsum(heights_mm) - heights_mm / 2
    axis.set(yticks=rows, ylim=(heights_mm.sum(), 0))
    axis.set_yticklabels(labels, fontsize=7, linespacing=1.0)
    axis.grid(visible=False, axis="y")
    return rows


def rank_candidates(table: Mapping[str, np.ndarray]) -> np.ndarray:
    """Indices (tested,) of the tested candidates by falling Bayes factor; each at the
    best value of its shape."""
    tested = np.flatnonzero(np.isfinite(table["log_bayes_factor"]))
    order = tested[np.argsort(-table["log_bayes_factor"][tested], kind="stable")]
    _, first = np.unique(table["candidate"][order].astype(str), return_index=True)
    return order[np.sort(first)]


def shorten_candidate_name(key: str) -> str:
    """A candidate's key as words, in two lines where it is long and cut in the middle
    where it is very long."""
    words = capital(candidate_words(key))
    words = (
        words
        if len(words) <= _LONGEST
        else f"{words[: _LONGEST // 2]} … {words[-(_LONGEST // 2 - 2) :]}"
    )
    return textwrap.fill(words, 48)


@styled
def draw_budget_bars(
    budget: Sequence[Mapping[str, Any]],
    names: Sequence[str],
    tolerance_m: float,
    tracker_m: float,
) -> Figure:
    """Lines of an error budget as bars, the largest first, against the tolerance.

    `budget`: ``name, rms_m``. `names`: of the lines, in words. `tracker_m`: RMS
    position error that the tracker's noise alone shows.
    """
    own = {"name": TRACKER, "rms_m": tracker_m}
    lines = [*zip(names, budget, strict=True), ("noise of the tracker alone", own)]
    shown = sorted(
        (line for line in lines if line[1]["rms_m"] > 0.0),
        key=lambda line: -line[1]["rms_m"],
    )
    figure, axes = create_panels(1, 1, 26 + 6.5 * len(shown))
    axis = axes[0, 0]
    kinds = []
    for row, (_, line) in enumerate(shown):
        kind = (
            line["name"]
            if line["name"] in _SHARES
            else "rest"
            if line["name"] in _REST
            else "effect"
        )
        kinds.append(kind)
        size = MILLI * line["rms_m"]
        axis.barh(
            row,
            size,
            height=0.6,
            color=_SHARES[kind][0],
            edgecolor="black" if kind == TRACKER else None,
            linewidth=0.6,
        )
        style: dict[str, Any] = {
            "fontsize": 7,
            "bbox": {"facecolor": "white", "edgecolor": "none", "pad": 0.6},
        }
        axis.annotate(
            f"{size:.3f}",
            (size, row),
            (4, 0),
            textcoords="offset points",
            va="center",
            **style,
        )
    axis.axvline(
        MILLI * tolerance_m,
        color=PALETTE[1],
        ls="--",
        zorder=0,
        label=f"tolerance {MILLI * tolerance_m:g} mm",
    )
    axis.set(
        xlim=(0, 1.1 * max(axis.get_xlim()[1], MILLI * tolerance_m)),
        xlabel="predicted RMS position error (mm)",
    )
    axis.set_yticks(range(len(shown)), [name for name, _ in shown])
    axis.invert_yaxis()
    axis.grid(visible=False, axis="y")
    handles: list[Artist] = [
        Patch(
            facecolor=color,
            edgecolor="black" if kind == TRACKER else color,
            linewidth=0.6,
            label=label,
        )
        for kind, (color, label) in _SHARES.items()
        if kind in kinds
    ]
    figure.legend(
        handles=[*handles, *axis.get_legend_handles_labels()[0]],
        loc="outside lower center",
        ncols=3,
    )
    return figure
