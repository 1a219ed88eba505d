"""The figure of a certificate: what each effect costs."""

from collections.abc import Mapping, Sequence
from typing import Any

from matplotlib.artist import Artist
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from elastocal.figures.style import MILLI, PALETTE, panels, styled

# What is left however well the robot is corrected.
_REST = ("uncertainty of the parameters", "repeatability", "form of the model", "not commanded", "left by the regression")
TRACKER = "tracker"
_KINDS = {
    "uncorrected": ("#b9b9b9", "without any correction"),
    "effect": (PALETTE[0], "if this alone were left out"),
    "rest": (PALETTE[2], "left after correction"),
    TRACKER: ("#ffffff", "in no robot: noise of a single measurement"),
}


@styled
def budget_bars(budget: Sequence[Mapping[str, Any]], names: Sequence[str], tolerance_m: float, tracker_m: float) -> Figure:
    """Lines of an error budget as bars, the largest first, against the tolerance.

    `budget`: ``name, rms_m``. `names`: of the lines, in words. `tracker_m`: RMS position error that the
    tracker's noise alone shows.
    """
    own = {"name": TRACKER, "rms_m": tracker_m}
    lines = [*zip(names, budget, strict=True), ("noise of the tracker alone", own)]
    shown = sorted((line for line in lines if line[1]["rms_m"] > 0.0), key=lambda line: -line[1]["rms_m"])
    figure, axes = panels(1, 1, 26 + 6.5 * len(shown))
    axis, kinds = axes[0, 0], []
    for row, (_, line) in enumerate(shown):
        kind = line["name"] if line["name"] in _KINDS else "rest" if line["name"] in _REST else "effect"
        kinds.append(kind)
        size = MILLI * line["rms_m"]
        axis.barh(row, size, height=0.6, color=_KINDS[kind][0], edgecolor="black" if kind == TRACKER else None, linewidth=0.6)
        style: dict[str, Any] = {"fontsize": 7, "bbox": {"facecolor": "white", "edgecolor": "none", "pad": 0.6}}
        axis.annotate(f"{size:.3f}", (size, row), (4, 0), textcoords="offset points", va="center", **style)
    axis.axvline(MILLI * tolerance_m, color=PALETTE[1], ls="--", zorder=0, label=f"tolerance {MILLI * tolerance_m:g} mm")
    axis.set(xlim=(0, 1.1 * max(axis.get_xlim()[1], MILLI * tolerance_m)), xlabel="predicted RMS position error (mm)")
    axis.set_yticks(range(len(shown)), [name for name, _ in shown])
    axis.invert_yaxis()
    axis.grid(visible=False, axis="y")
    handles: list[Artist] = [
        Patch(facecolor=color, edgecolor="black" if kind == TRACKER else color, linewidth=0.6, label=label)
        for kind, (color, label) in _KINDS.items()
        if kind in kinds
    ]
    figure.legend(handles=[*handles, *axis.get_legend_handles_labels()[0]], loc="outside lower center", ncols=3)
    return figure
