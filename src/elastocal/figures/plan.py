"""A plan as a picture: where the targets will be, from above and from the side, and what each further pose is worth."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.patches import Rectangle

from elastocal.application.planning.cell import link_points
from elastocal.figures.style import PALETTE, panels, styled
from elastocal.mechanics.kinematics import poses

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from elastocal.application.planning.cell import Cell
    from elastocal.application.planning.plan import Plan
    from elastocal.mechanics.robot import Robot

# Of the curve, above its end.
_SHOWN_TIMES = 30.0
_VIEWS = (("from above", 0, 1), ("from the side", 0, 2))


@styled
def plan_picture(robot: Robot, cell: Cell, plan: Plan) -> Figure:
    """Configurations in the cell, and the accuracy against the number of poses."""
    figure, axes = panels(1, 3, 72)
    for axis, (words, across, up) in zip(axes[0], _VIEWS, strict=False):
        _view(axis, robot, cell, plan, across, up)
        axis.set_title(words)
    _curves(axes[0, 2], plan)
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower left", ncols=5)
    return figure


def _view(axis: Axes, robot: Robot, cell: Cell, plan: Plan, across: int, up: int) -> None:
    for number, (name, some) in enumerate((("to fit", plan.fitted), ("held out", plan.held_out))):
        if not len(some.joint_angles):
            continue
        angles = robot.model_angles(some.joint_angles)
        for arm in link_points(robot, angles).transpose(1, 0, 2):
            axis.plot(arm[:, across], arm[:, up], color="#c8c8c8", lw=0.6, zorder=1)
        at, _ = poses(robot.chain, angles, robot.chain.end_effector)
        axis.plot(at[:, across], at[:, up], "os"[number], color=PALETTE[number], ms=3.5, label=name, zorder=2)
    for number, box in enumerate(cell.boxes):
        size = box[:, 1] - box[:, 0]
        corner = box[across, 0], box[up, 0]
        axis.add_patch(_rectangle(corner, size[across], size[up], "kept out of" if number == 0 else None))
    if cell.tracker_m is not None:
        axis.plot(cell.tracker_m[across], cell.tracker_m[up], "^", color=PALETTE[2], ms=6, label="tracker")
    axis.plot(0.0, 0.0, "k+", ms=8, label="base")
    axis.set_aspect("equal", adjustable="box")
    axis.set_xlabel(f"{'xyz'[across]} (m)")
    axis.set_ylabel(f"{'xyz'[up]} (m)")
    # Boxes may stand for a floor without an end: the arm says what is shown.
    reach = max(np.abs(link_points(robot, robot.model_angles(plan.fitted.joint_angles))).max(), 0.1)
    shown = [reach] if cell.tracker_m is None else [reach, float(np.abs(cell.tracker_m).max())]
    axis.set_xlim(-1.1 * reach, 1.1 * max(shown))
    axis.set_ylim(-1.1 * reach, 1.1 * reach)


def _rectangle(corner: tuple[float, float], width: float, height: float, label: str | None) -> Rectangle:
    return Rectangle(corner, width, height, facecolor="#f2d7c9", edgecolor="#D55E00", lw=0.6, label=label, zorder=0)


def _curves(axis: Axes, plan: Plan) -> None:
    count = np.arange(1, len(plan.accuracy_m) + 1)
    low, middle, high = 1e3 * np.quantile(plan.random_m, [0.05, 0.5, 0.95], axis=0)
    axis.fill_between(count, low, high, color=PALETTE[1], alpha=0.2, lw=0)
    axis.plot(count, middle, color=PALETTE[1], label="random poses, 5 to 95 %")
    axis.plot(count, 1e3 * plan.accuracy_m, color=PALETTE[0], label="this plan")
    # With too few poses hardly anything is known: nobody measures so few.
    axis.set_ylim(0.5e3 * plan.accuracy_m[-1], _SHOWN_TIMES * 1e3 * plan.accuracy_m[-1])
    axis.set_yscale("log")
    axis.set_xlabel("poses")
    axis.set_ylabel("position error left, RMS (mm)")
    axis.set_title("what each pose is worth")
    axis.legend(loc="upper right")
