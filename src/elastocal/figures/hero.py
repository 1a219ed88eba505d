"""The robot with its errors at held-out poses, before and after: the picture at the top of README."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from elastocal.application.planning.cell import link_points
from elastocal.figures.arm_view import draw_arm, project_view
from elastocal.figures.style import PALETTE, panels, styled

if TYPE_CHECKING:
    from collections.abc import Mapping

    from matplotlib.figure import Figure

    from elastocal.mechanics.robot import Robot

# Errors are drawn so many times larger than they are.
_TIMES = 400
_STAGES = (("before", "declared model", PALETTE[1]), ("after", "with the effect found", PALETTE[0]))


@styled
def arm_with_errors(robot: Robot, table: Mapping[str, np.ndarray], heldout: Mapping[str, Any]) -> Figure:
    """Two panels, before and after: the arm in one of the held-out poses, and an arrow for each of their errors.

    `table`: columns of the residuals table. `heldout`: of verdict.json, whose RMS errors the titles state.
    """
    seen = table["held_out"].astype(bool)
    angles = np.column_stack([table[f"q{joint}"][seen] for joint in range(1, robot.joints + 1)])
    at = np.column_stack([table[axis][seen] for axis in "xyz"])
    arms = link_points(robot, robot.model_angles(np.unique(angles, axis=0))).transpose(1, 0, 2)
    # One arm in full, the one that reaches farthest to a side; the others as thin lines.
    links = arms[np.argmax(np.abs(project_view(arms[:, -1])[:, 0]))]
    figure, axes = panels(1, 2, 78, sharex=True, sharey=True)
    for axis, (stage, words, color) in zip(axes[0], _STAGES, strict=True):
        off = np.column_stack([table[f"{stage}_d{each}"][seen] for each in "xyz"])
        for arm in arms:
            axis.plot(*project_view(arm).T, color="#dde2e6", lw=1.2, zorder=0)
        draw_arm(axis, links, 11)
        start, tip = project_view(at), project_view(at + _TIMES * off)
        look: dict[str, Any] = {"angles": "xy", "scale_units": "xy", "scale": 1, "width": 0.005, "zorder": 3}
        axis.quiver(*start.T, *(tip - start).T, color=color, gid=stage, **look)
        axis.update_datalim(tip)
        error = f"{1e3 * heldout[stage]['rms_m']:.2f} mm"
        axis.set_title(error, fontsize=17, fontweight="bold", color=color, loc="left", pad=14)
        axis.text(0, 1.015, words, transform=axis.transAxes, fontsize=9, color="#444444")
        axis.set_aspect("equal")
        axis.set_axis_off()
        axis.margins(0.03)
    figure.supxlabel(
        f"RMS position error at {heldout['poses']} held-out poses; arrows: {_TIMES} times the error; "
        f"the tracker's noise alone: {1e3 * heldout['noise_floor_rms_m']:.2f} mm",
        fontsize=7.5,
        color="#444444",
    )
    return figure
