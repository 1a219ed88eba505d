"""Errors on held-out poses, model by model."""

import textwrap
from collections.abc import Collection, Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from elastocal.counting import first_names
from elastocal.diagnosis.words import in_words
from elastocal.figures.residuals import MICRO, MILLI
from elastocal.figures.style import PALETTE, panels, styled

METRICS = {"mean": "mean", "rms": "RMS", "p95": "95th percentile", "max": "maximum"}
LOOKS = {
    "frames": ("#b9b9b9", "frames and targets only"),
    "declared": (PALETTE[1], "declared model"),
    "effect": (PALETTE[0], "with the effects found"),
    "kept": ("#777777", "frames and targets only, kept"),
}
# Beyond this ratio the smallest bars would be lost on a linear axis.
_LARGEST_RATIO = 25
_LINE = 26
_DIAMOND: dict[str, Any] = {"linestyle": "", "marker": "D", "color": "white", "markeredgecolor": "black", "markersize": 3.4}


@styled
def before_after(steps: Sequence[Mapping[str, Any]], noise_floor_m: float | None = None) -> Figure:
    """Bars of the errors on held-out poses, one for each model.

    `steps`: rows of before_after.csv. `noise_floor_m`: RMS error that the noise alone leaves.
    """
    labels = [step_name(step["step"]) for step in steps]
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
            _interval(axis, value, low, high, row)
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
    figure.legend(handles=_legend({step["kind"] for step in steps}, noise_floor_m), loc="outside lower center", ncols=3)
    return figure


def _interval(axis: Axes, value: float, low: float, high: float, row: float) -> None:
    """A line from end to end; an arrow where it is open above; nothing where there is none."""
    axis.plot([low, value if np.isinf(high) else high], [row, row], color="black", linewidth=1.1, gid="interval")
    if np.isinf(high):
        axis.plot(value, row, ">", color="black", markersize=4, gid="open interval")


def step_name(name: str, most: int = 3) -> str:
    """Name of a model for people: words, with the ends of long lists left out, in lines that fit beside the bars."""
    return textwrap.fill(first_names(in_words(name).split(", "), most), _LINE)


def _legend(kinds: Collection[str], noise_floor_m: float | None) -> list[Artist]:
    handles: list[Artist] = [Patch(color=color, label=label) for kind, (color, label) in LOOKS.items() if kind in kinds]
    handles.append(Line2D([], [], color="black", linewidth=1.1, label="95 % interval over poses"))
    handles.append(Line2D([], [], **_DIAMOND, label="on fitted poses"))
    if noise_floor_m:
        handles.append(Line2D([], [], color="black", linestyle=":", linewidth=1.2, label="RMS that noise alone leaves"))
    return handles
