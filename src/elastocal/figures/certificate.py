"""Figures of a certificate: errors over the workspace, and what each effect costs."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Rectangle

from elastocal.application.certificate import WorkspaceErrors
from elastocal.figures.style import MILLI, PALETTE, panels, styled

_BINS = 24
_FEWEST = 3
# Light to dark: the larger error is the darker one, in grey too.
_COLOURS = "viridis_r"
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
def workspace_map(maps: Sequence[WorkspaceErrors], forces_N: Sequence[float], tolerance_m: float) -> Figure:
    """RMS error over distance from the base axis and height, uncorrected and corrected, on one logarithmic scale.

    `maps`: one row of panels each. `forces_N`: hanging load of each. `tolerance_m`: drawn as a contour.
    """
    figure, axes = panels(len(maps), 2, 62 * len(maps) + 16, sharex=True, sharey=True)
    grids = [[np.sqrt(_grid(errors, values**2)[0]) for values in (errors.uncorrected_m, errors.corrected_m)] for errors in maps]
    known = np.concatenate([found[np.isfinite(found)] for pair in grids for found in pair] + [[tolerance_m]])
    scale = LogNorm(MILLI * known[known > 0].min(), MILLI * known.max())
    for row, errors, pair, force in zip(axes, maps, grids, forces_N, strict=True):
        load = f"{force:.0f} N hanging" if force else "no load"
        for axis, found, title in zip(row, pair, ("uncorrected", "corrected"), strict=True):
            image = _panel(axis, errors, found, scale, tolerance_m)
            axis.set_title(f"{title}, {load}")
        row[0].set_ylabel("height above the base (m)")
        if errors.regressed.any():
            acts, edges = _grid(errors, errors.regressed.astype(float))
            _mark(row[1], edges, acts > 0.0, "....", "#000000aa")
    for axis in axes[-1]:
        axis.set_xlabel("distance from the base's vertical axis (m)")
    bar = figure.colorbar(image, ax=axes.ravel().tolist(), label="predicted RMS position error (mm)")
    bar.ax.yaxis.set_major_formatter("{x:g}")
    bar.ax.axhline(MILLI * tolerance_m, color="black", lw=1.6)
    handles = [
        Line2D([], [], color="black", lw=1.6, label=f"tolerance {MILLI * tolerance_m:g} mm"),
        Patch(facecolor="none", edgecolor="#555555", hatch="////", lw=0.0, label="mostly beyond the range of the fitted poses"),
    ]
    if any(errors.regressed.any() for errors in maps):
        words = "some poses corrected by the regression too"
        handles.append(Patch(facecolor="none", edgecolor="#555555", hatch="....", lw=0.0, label=words))
    figure.legend(handles=handles, loc="outside lower center", ncols=2)
    return figure


def _grid(errors: WorkspaceErrors, values: np.ndarray) -> tuple[np.ndarray, list[np.ndarray]]:
    """Mean of values (N,) over distance from the base axis and height, (bins, bins), and the edges of the cells in m.

    Not a number in cells of few poses.
    """
    at = np.hypot(errors.position[:, 0], errors.position[:, 1]), errors.position[:, 2]
    counts, *edges = np.histogram2d(*at, bins=_BINS)
    sums = np.histogram2d(*at, bins=edges, weights=values)[0]
    return np.divide(sums, counts, out=np.full_like(sums, np.nan), where=counts >= _FEWEST), edges


def _panel(axis: Axes, errors: WorkspaceErrors, found: np.ndarray, scale: LogNorm, tolerance_m: float) -> Any:
    outside, edges = _grid(errors, errors.outside.astype(float))
    image = axis.pcolormesh(edges[0], edges[1], MILLI * found.T, cmap=_COLOURS, norm=scale, rasterized=True)
    middles = [(ends[1:] + ends[:-1]) / 2 for ends in edges]
    if np.nanmin(found) < tolerance_m < np.nanmax(found):
        axis.contour(*middles, found.T, levels=[tolerance_m], colors="black", linewidths=1.6)
    _mark(axis, edges, np.isfinite(found) & (outside > 0.5), "////", "#ffffffaa")
    axis.set_aspect("equal")
    axis.grid(visible=False)
    return image


def _mark(axis: Axes, edges: list[np.ndarray], cells: np.ndarray, hatch: str, color: str) -> None:
    """Hatch some cells (bins, bins) of a map."""
    size = edges[0][1] - edges[0][0], edges[1][1] - edges[1][0]
    for across, up in np.argwhere(cells):
        corner = edges[0][across], edges[1][up]
        axis.add_patch(Rectangle(corner, *size, fill=False, hatch=hatch, lw=0.0, edgecolor=color))


@styled
def budget_bars(budget: Sequence[Mapping[str, Any]], names: Sequence[str], tolerance_m: float, tracker_m: float) -> Figure:
    """Lines of an error budget as bars with their intervals, the largest first, against the tolerance.

    `budget`: ``name, rms_m, low_m, high_m``. `names`: of the lines, in words. `tracker_m`: RMS position error that the
    tracker's noise alone shows.
    """
    own = {"name": TRACKER, "rms_m": tracker_m, "low_m": None, "high_m": None}
    lines = [*zip(names, budget, strict=True), ("noise of the tracker alone", own)]
    shown = sorted((line for line in lines if line[1]["rms_m"] > 0.0), key=lambda line: -line[1]["rms_m"])
    figure, axes = panels(1, 1, 26 + 6.5 * len(shown))
    axis, kinds = axes[0, 0], []
    for row, (_, line) in enumerate(shown):
        kind = line["name"] if line["name"] in _KINDS else "rest" if line["name"] in _REST else "effect"
        kinds.append(kind)
        size, end = MILLI * line["rms_m"], MILLI * (line["high_m"] or line["rms_m"])
        axis.barh(row, size, height=0.6, color=_KINDS[kind][0], edgecolor="black" if kind == TRACKER else None, linewidth=0.6)
        if line["low_m"] is not None:
            axis.plot([MILLI * line["low_m"], end], [row, row], color="black", lw=1.2)
        style: dict[str, Any] = {"fontsize": 7, "bbox": {"facecolor": "white", "edgecolor": "none", "pad": 0.6}}
        axis.annotate(f"{size:.3f}", (max(size, end), row), (4, 0), textcoords="offset points", va="center", **style)
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
