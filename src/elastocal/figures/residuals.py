"""Errors of a campaign, before and after: as arrows where the robot stood, and model by model."""

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

from elastocal.counting import counted, first_names
from elastocal.figures.arms import draw_links
from elastocal.figures.style import MICRO, MILLI, STAGES, label_decades, legend_below, panels, styled
from elastocal.report.words import in_words

# Of more states than this only one is drawn in each cell of a grid of so many columns.
_MOST_ARROWS = 320
_CELLS = 18
# Length of the arrow of a large residual, as a share of the workspace.
_ARROW = 0.13

METRICS = {"mean": "mean", "rms": "RMS", "p95": "95th percentile", "max": "maximum"}
LOOKS = {
    "frames": ("#b9b9b9", "frames and targets only"),
    "declared": STAGES["before"][::-1],
    "effect": STAGES["after"][::-1],
    "kept": ("#777777", "frames and targets only, kept"),
}
# Beyond this ratio the smallest bars would be lost on a linear axis.
_LARGEST_RATIO = 25
_LINE, _NAMES = 26, 3
_DIAMOND: dict[str, Any] = {"linestyle": "", "marker": "D", "color": "white", "markeredgecolor": "black", "markersize": 3.4}


@styled
def arrows(table: Mapping[str, np.ndarray], arm: np.ndarray | None = None) -> Figure:
    """Residuals as arrows where the measurements were taken, from the side and from above.

    `table`: columns of the residuals table. `arm` (K, 3): corners of the robot in one pose, m. Repeats are averaged; where
    states are still many, one of each cell of a grid is drawn.
    """
    place, off, stages = *_states(table), _stages(table)
    size = np.linalg.norm(off["before"], axis=1)
    largest = max(np.quantile(size, 0.95), 1e-9)
    extent = np.maximum(np.ptp(place, axis=0), 1e-3)
    # One digit: the side of a cell is a number that can be quoted.
    digit = 10.0 ** np.floor(np.log10(extent.max() / _CELLS))
    cell_m = float(np.ceil(extent.max() / _CELLS / digit) * digit) if len(place) > _MOST_ARROWS else None
    views = {"from the side": (0, 2), "from above": (0, 1)}
    figure, axes = panels(1, 2, 26 + float(np.clip(66 * extent[1:].max() / extent[0], 40, 56)))
    length = _ARROW * extent.max()
    for axis, (title, seen) in zip(axes[0], views.items(), strict=True):
        shown = np.arange(len(place)) if cell_m is None else middle_of_cells(place[:, seen], size, cell_m)
        at = place[shown][:, seen]
        for order, stage in enumerate(stages):
            tips = at + off[stage][shown][:, seen] * length / largest
            head = {"width": 0.006 - 0.0025 * order, "headwidth": 3.2, "headlength": 4, "headaxislength": 3.6, "minlength": 0.3}
            arrow = axis.quiver(*at.T, *(tips - at).T, angles="xy", scale_units="xy", scale=1, color=STAGES[stage][1], **head)
            arrow.set(zorder=3 + order, gid=stage)
            axis.update_datalim(tips)
        if arm is not None:
            draw_links(axis, arm[:, seen])
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
    handles = [Line2D([], [], color=STAGES[stage][1], linewidth=2, label=STAGES[stage][0]) for stage in stages]
    figure.legend(handles=handles, title=which, loc="outside lower center", ncols=2)
    return figure


def middle_of_cells(at: np.ndarray, size: np.ndarray, side: float) -> np.ndarray:
    """The state of middle size in each cell of a grid.

    `at` (N, 2): m. `size` (N,). `side`: m. Returns (cells,) of int: one for each cell that is not empty.
    """
    _, cell = np.unique(np.floor(at / side).astype(int), axis=0, return_inverse=True)
    order = np.lexsort((size, cell.ravel()))
    counts = np.bincount(cell.ravel())
    return order[np.cumsum(counts) - counts + (counts - 1) // 2]


def _stages(table: Mapping[str, np.ndarray]) -> tuple[str, ...]:
    """Both stages, or the first alone where nothing was found that changes a residual."""
    same = all(np.allclose(table[f"before_d{axis}"], table[f"after_d{axis}"], rtol=0, atol=1e-9) for axis in "xyz")
    return tuple(STAGES)[: 1 if same else 2]


def _states(table: Mapping[str, np.ndarray]) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Mean place and residuals of each state and target."""
    keys = ["held_out", "session", "pose", "load", "target"]
    seen = [*"xyz", *(f"{stage}_d{axis}" for stage in STAGES for axis in "xyz")]
    means = pd.DataFrame({name: table[name] for name in keys + seen}).groupby(keys, dropna=False, observed=True).mean()
    off = {stage: means[[f"{stage}_d{axis}" for axis in "xyz"]].to_numpy() for stage in STAGES}
    return means[[*"xyz"]].to_numpy(), off


def _scale_arrow(axis: Axes, largest: float, length: float) -> None:
    """An arrow of a round length beside the title."""
    digit = 10.0 ** np.floor(np.log10(largest))
    shown = max(step for step in (1, 2, 5) if step * digit <= largest * (1 + 1e-9)) * digit
    scale, unit = (MILLI, "mm") if shown > 0.9995e-3 else (MICRO, "µm")
    key = axis.quiver([0], [0], [0], [0], angles="xy", scale_units="xy", scale=1, color="black", width=0.006, minlength=0)
    place = {"labelpos": "W", "coordinates": "axes", "fontproperties": {"size": 8}}
    axis.quiverkey(key, 0.88, 1.035, shown * length / largest, f"{scale * shown:g} {unit}", **place)
    key.set_visible(False)


@styled
def before_after(steps: Sequence[Mapping[str, Any]], noise_floor_m: float | None = None) -> Figure:
    """Bars of the errors on held-out poses, one for each model.

    `steps`: rows of before_after.csv. `noise_floor_m`: RMS error that the noise alone leaves.
    """
    # Words, with the ends of long lists left out, in lines that fit beside the bars.
    labels = [textwrap.fill(first_names(in_words(step["step"]).split(", "), _NAMES), _LINE) for step in steps]
    lines = [label.count("\n") + 1 for label in labels]
    figure, axes = panels(1, len(METRICS), 30 + 4.0 * sum(lines) + 4.5 * len(steps), sharey=True)
    # Rows as high as their names are long.
    heights = np.array([0.55 + 0.45 * count for count in lines])
    rows = np.cumsum(heights) - heights / 2
    values = np.array([[step[f"heldout_{metric}_m"] for metric in METRICS] for step in steps])
    scale, unit = (MILLI, "mm") if values.max() >= 1e-3 else (MICRO, "µm")
    trained = np.array([[step[f"train_{metric}_m"] for metric in METRICS] for step in steps])
    known = [*values[values > 0], *([noise_floor_m] if noise_floor_m else [])]
    logarithmic = max(known) > _LARGEST_RATIO * min(known)
    for axis, (metric, title) in zip(axes[0], METRICS.items(), strict=True):
        for row, step in zip(rows, steps, strict=True):
            value, low, high = (scale * step[f"heldout_{metric}_m{end}"] for end in ("", "_low", "_high"))
            axis.barh(row, value, height=0.42, color=LOOKS[step["kind"]][0])
            # An arrow where the interval is open above; nothing where there is none.
            axis.plot([low, value if np.isinf(high) else high], [row, row], color="black", linewidth=1.1, gid="interval")
            if np.isinf(high):
                axis.plot(value, row, ">", color="black", markersize=4, gid="open interval")
            axis.plot(scale * step[f"train_{metric}_m"], row, **_DIAMOND)
        if noise_floor_m:
            axis.axvline(scale * noise_floor_m, color="black", linestyle=":", linewidth=1.2, gid="noise floor")
        axis.set(title=title, xlabel=f"error ({unit})")
        if logarithmic:
            axis.set(xscale="log", xlim=(0.5 * scale * min(known), 1.6 * scale * max(values.max(), trained.max())))
            axis.xaxis.set_major_formatter("{x:g}")
        else:
            axis.set_xlim(0, None)
        axis.grid(visible=False, axis="y")
        axis.set_axisbelow(True)
    axes[0, 0].set(yticks=rows, ylim=(heights.sum(), 0))
    axes[0, 0].set_yticklabels(labels, fontsize=7.5)
    kinds = {step["kind"] for step in steps}
    handles: list[Artist] = [Patch(color=color, label=label) for kind, (color, label) in LOOKS.items() if kind in kinds]
    handles.append(Line2D([], [], color="black", linewidth=1.1, label="95 % interval over poses"))
    handles.append(Line2D([], [], **_DIAMOND, label="on fitted poses"))
    if noise_floor_m:
        handles.append(Line2D([], [], color="black", linestyle=":", linewidth=1.2, label="RMS that noise alone leaves"))
    figure.legend(handles=handles, loc="outside lower center", ncols=3)
    return figure


@styled
def campaign_errors(table: pd.DataFrame) -> Figure:
    """Root mean square errors with their intervals, a line for each campaign.

    `table`: ``campaign``, ``poses``, and ``before_rms_mm``, ``before_rms_low_mm``, ``before_rms_high_mm``, the same for after:
    mm.
    """
    rows = np.arange(len(table))[::-1]
    figure, axes = panels(1, 1, 24 + 6 * len(table))
    axis = axes[0, 0]
    axis.hlines(rows, table["after_rms_mm"], table["before_rms_mm"], color="#c8c8c8", lw=2.5, zorder=1)
    for stage, (words, color) in STAGES.items():
        rms, low, high = (table[f"{stage}_rms{end}_mm"].to_numpy(float) for end in ("", "_low", "_high"))
        # An interval that is open above is drawn to the value alone.
        span = [rms - low, np.where(np.isfinite(high), high - rms, 0.0)]
        axis.errorbar(rms, rows, xerr=span, fmt="o", color=color, ms=4, lw=1.2, capsize=2, label=words, zorder=2)
    # Robots and series in capitals, as people write them.
    names = table["campaign"].str.replace("_on_", ", judged on ").str.replace("_", " ")
    names = names.str.replace(r"^\w+|\b\w\b", lambda word: word[0].upper(), regex=True)
    # A campaign with two sessions has two lines.
    names = names.where(~names.duplicated(keep=False), names + ", " + table["poses"].map(lambda count: counted(count, "pose")))
    axis.set_yticks(rows, names)
    axis.set(xscale="log", xlabel="RMS position error of held-out poses (mm), with 95 % intervals")
    label_decades(axis.xaxis)
    axis.grid(visible=False, axis="y")
    legend_below(figure, 2)
    return figure
