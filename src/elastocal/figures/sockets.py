"""A ball in printed sockets: the tool, and where the model puts the ball of held-out
poses, before and after."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.patches import Circle, Polygon, Rectangle, Wedge

from elastocal.figures.style import MILLI, PALETTE, STAGES, create_panels, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from elastocal.io.storage import Columns
    from elastocal.verdict import HeldOut

_HEIGHT_MM = 62
# Sizes of the sketch, mm: distance of the sockets, radius of the ball, plate.
_DISTANCE_MM = 50.0
_BALL_MM = 8.0
_PLATE_MM = 14.0
_GREY = "#b9b9b9"
# Side of the window that enlarges the errors after calibration, mm, and its place.
_ENLARGED_MM = 1.5
# Components that are drawn to the right and upwards.
_AXES = ("dx", "dz")
_INSET = (0.56, 0.56, 0.42, 0.42)


@styled
def draw_sockets(residuals: Columns, heldout: HeldOut) -> Figure:
    """Draw the tool and the ball at held-out poses relative to its socket.

    Parameters
    ----------
    residuals : columns of the residuals of a campaign, one row for each pose.
    heldout : errors of the campaign's verdict.
    """
    figure, axes = create_panels(1, 3, _HEIGHT_MM)
    sketch, before, after = axes[0]
    _draw_tool(sketch)
    rows = residuals["held_out"] & ~residuals["gross_error"]
    poses = int(rows.sum())
    limit = np.abs(_get_points_mm(residuals, "before", rows)).max()
    for axis, stage, rms_m in (
        (before, "before", heldout.before.rms_m),
        (after, "after", heldout.after.rms_m),
    ):
        colour = STAGES[stage][1]
        points = _get_points_mm(residuals, stage, rows)
        _draw_points(axis, points, colour, 1.05 * limit)
        axis.set_title(f"{stage}: {MILLI * rms_m:.3g} mm RMS")
        axis.set_xlabel(f"x (mm), {poses} held-out poses")
    before.set_ylabel("ball from its socket, z (mm)")
    inset = after.inset_axes(_INSET)
    _draw_points(inset, points, colour, _ENLARGED_MM)
    inset.tick_params(labelsize=6)
    return figure


def _get_points_mm(residuals: Columns, stage: str, rows: np.ndarray) -> np.ndarray:
    """Return the residuals of some rows (N, 2), mm, in the drawn components."""
    components = [residuals[f"{stage}_{axis}"][rows] for axis in _AXES]
    return np.asarray(MILLI * np.column_stack(components))


def _draw_points(axis: Axes, points: np.ndarray, colour: str, limit: float) -> None:
    """Draw points (N, 2), mm, about the centre of the socket."""
    axis.axhline(0.0, color=_GREY, linewidth=0.5)
    axis.axvline(0.0, color=_GREY, linewidth=0.5)
    axis.plot(*points.T, ".", color=colour, markersize=3)
    axis.set_xlim(-limit, limit)
    axis.set_ylim(-limit, limit)
    axis.set_aspect("equal")


def _draw_tool(axis: Axes) -> None:
    """Draw the plate with two sockets and the ball on the flange."""
    width = _DISTANCE_MM + 4 * _BALL_MM
    left_edge = -width / 2
    axis.add_patch(
        Rectangle((left_edge, -_PLATE_MM), width, _PLATE_MM, color=_GREY, linewidth=0)
    )
    for x in (-_DISTANCE_MM / 2, _DISTANCE_MM / 2):
        axis.add_patch(Wedge((x, 0.0), _BALL_MM, 180, 360, color="white", linewidth=0))
    x = _DISTANCE_MM / 2
    axis.add_patch(Circle((x, 0.0), _BALL_MM - 0.5, color=PALETTE[0], linewidth=0))
    stem = [(x - 2.5, 6.0), (x + 2.5, 6.0), (x + 10.0, 40.0), (x + 3.0, 40.0)]
    axis.add_patch(Polygon(stem, color=PALETTE[0], linewidth=0))
    flange = [(x - 8.0, 40.0), (x + 21.0, 40.0), (x + 21.0, 52.0), (x - 8.0, 52.0)]
    axis.add_patch(Polygon(flange, color=PALETTE[7], linewidth=0))
    axis.annotate(
        "",
        (-x, -_PLATE_MM - 6),
        (x, -_PLATE_MM - 6),
        arrowprops={"arrowstyle": "<->", "linewidth": 0.8},
    )
    axis.text(0.0, -_PLATE_MM - 9, f"{_DISTANCE_MM:g} mm", ha="center", va="top")
    axis.text(x - 11.0, 46.0, "flange", ha="right", va="center")
    axis.text(x - 6.0, 22.0, "ball", ha="right", va="center")
    axis.text(-x, 12.0, "socket", ha="center")
    axis.set_xlim(left_edge - 4, width / 2 + 4)
    axis.set_ylim(-_PLATE_MM - 22, 60)
    axis.set_aspect("equal")
    axis.set_axis_off()
