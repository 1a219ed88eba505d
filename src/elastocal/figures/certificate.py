"""Figures of a certificate: errors over the workspace, and what each effect costs."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.patches import Patch, Rectangle
from scipy.stats import binned_statistic_2d

from elastocal.figures.style import PALETTE, panels, styled

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from typing import Any

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from elastocal.application.certificate.workspace import WorkspaceErrors

_BINS = 24
_FEWEST = 3
_MILLI = 1e3
# What is left however well the robot is corrected.
_REST = ("uncertainty of the parameters", "repeatability", "form of the model", "not commanded")


@styled
def workspace_map(maps: Sequence[WorkspaceErrors], forces_N: Sequence[float]) -> Figure:
    """Errors over distance from the base axis and height: uncorrected, and the bound of the corrected robot.

    `maps`: one row of panels each. `forces_N`: hanging load of each.
    """
    figure, axes = panels(len(maps), 2, 70 * len(maps), sharex=True, sharey=True)
    for row, (errors, force) in zip(axes, zip(maps, forces_N, strict=True), strict=True):
        load = f"{force:.0f} N hanging" if force else "no load"
        _panel(row[0], errors, errors.uncorrected_m, 0.5, f"uncorrected, {load}", "median error (mm)")
        _panel(row[1], errors, errors.bound_m, 0.95, f"corrected, {load}", "95 % bound of the error (mm)")
        row[0].set_ylabel("height above the base (m)")
    for axis in axes[-1]:
        axis.set_xlabel("distance from the base's vertical axis (m)")
    outside = Patch(
        facecolor="none", edgecolor="#555555", hatch="////", lw=0.0, label="mostly beyond the range of the fitted poses"
    )
    figure.legend(handles=[outside], loc="outside lower center")
    return figure


def _panel(axis: Axes, errors: WorkspaceErrors, values: np.ndarray, share: float, title: str, unit: str) -> None:
    radius, height = np.hypot(errors.position[:, 0], errors.position[:, 1]), errors.position[:, 2]
    edges = [np.linspace(values.min(), values.max(), _BINS + 1) for values in (radius, height)]

    def binned(what: np.ndarray, how: Any) -> np.ndarray:
        return np.asarray(binned_statistic_2d(radius, height, what, how, bins=edges).statistic)

    enough = binned(values, "count") >= _FEWEST
    found = np.where(enough, binned(values, lambda some: np.quantile(some, share)), np.nan)
    image = axis.pcolormesh(edges[0], edges[1], _MILLI * found.T, cmap="cividis", vmin=0.0, rasterized=True)
    beyond = enough & (binned(errors.outside.astype(float), "mean") > 0.5)
    for across, up in np.argwhere(beyond):
        corner = edges[0][across], edges[1][up]
        size = edges[0][1] - edges[0][0], edges[1][1] - edges[1][0]
        axis.add_patch(Rectangle(corner, *size, fill=False, hatch="////", lw=0.0, edgecolor="#ffffffaa"))
    axis.figure.colorbar(image, ax=axis, label=unit)
    axis.set_title(title)
    axis.set_aspect("equal")
    axis.grid(visible=False)


@styled
def budget_bars(budget: Sequence[Mapping[str, Any]], names: Sequence[str], tolerance_m: float) -> Figure:
    """Lines of an error budget as bars with their intervals, against the tolerance.

    `budget`: ``name, rms_m, low_m, high_m``. `names`: of the lines, in words.
    """
    shown = [line for line in budget if line["rms_m"] > 0.0]
    labels = [name for name, line in zip(names, budget, strict=True) if line["rms_m"] > 0.0]
    figure, axes = panels(1, 1, 22 + 6.5 * len(shown))
    axis = axes[0, 0]
    smallest = min(tolerance_m, *(line["low_m"] or line["rms_m"] for line in shown))
    for row, line in enumerate(shown):
        left = line["name"] in _REST
        axis.barh(row, _MILLI * line["rms_m"], height=0.6, color=PALETTE[2] if left else PALETTE[0] if row else "#b9b9b9")
        if line["low_m"] is not None:
            axis.plot(_MILLI * np.array([line["low_m"], line["high_m"]]), [row, row], color="black", lw=1.2)
    axis.axvline(_MILLI * tolerance_m, color=PALETTE[1], ls="--", label=f"tolerance {_MILLI * tolerance_m:g} mm")
    axis.set(xscale="log", xlim=(0.4 * _MILLI * smallest, None), xlabel="position error, RMS over the measured states (mm)")
    axis.xaxis.set_major_formatter("{x:g}")
    axis.set_yticks(range(len(shown)), labels)
    axis.invert_yaxis()
    axis.grid(visible=False, axis="y")
    handles = [
        Patch(color="#b9b9b9", label="without any correction"),
        Patch(color=PALETTE[0], label="if this alone were left out"),
        Patch(color=PALETTE[2], label="left after correction"),
        *axis.get_legend_handles_labels()[0],
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=4)
    return figure
