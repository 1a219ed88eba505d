"""A plan as pictures: where the targets will be, what each further pose is worth, and the robot in every pose."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.patches import Rectangle
from matplotlib.ticker import MaxNLocator

from elastocal.application.planning.cell import link_points
from elastocal.figures.arm_view import draw_arm, project_view
from elastocal.figures.style import PALETTE, label_decades, panels, styled
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
# Of the pictures of single poses: how many stand in a row and on a page.
_ACROSS, _MOST_ON_PAGE = 7, 56
# A force is drawn as long as this share of the reach.
_PULL = 0.35


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
        look: dict[str, Any] = {"facecolor": "#f2d7c9", "edgecolor": "#D55E00", "lw": 0.6, "zorder": 0}
        label = "kept out of" if number == 0 else None
        axis.add_patch(Rectangle((box[across, 0], box[up, 0]), size[across], size[up], label=label, **look))
    if cell.tracker_m is not None:
        axis.plot(cell.tracker_m[across], cell.tracker_m[up], "^", color=PALETTE[2], ms=6, label="tracker")
    axis.plot(0.0, 0.0, "k+", ms=8, label="base")
    axis.set(xlabel=f"{'xyz'[across]} (m)", ylabel=f"{'xyz'[up]} (m)")
    axis.set_aspect("equal", adjustable="box")
    # Boxes may stand for a floor without an end: the arm says what is shown.
    reach = max(np.abs(link_points(robot, robot.model_angles(plan.fitted.joint_angles))).max(), 0.1)
    shown = [reach] if cell.tracker_m is None else [reach, float(np.abs(cell.tracker_m).max())]
    axis.set(xlim=(-1.1 * reach, 1.1 * max(shown)), ylim=(-1.1 * reach, 1.1 * reach))


def _curves(axis: Axes, plan: Plan) -> None:
    count = np.arange(1, len(plan.accuracy_m) + 1)
    low, middle, high = 1e3 * np.quantile(plan.random_m, [0.05, 0.5, 0.95], axis=0)
    axis.fill_between(count, low, high, color=PALETTE[1], alpha=0.2, lw=0)
    axis.plot(count, middle, color=PALETTE[1], label="random poses, 5 to 95 %")
    axis.plot(count, 1e3 * plan.accuracy_m, color=PALETTE[0], label="this plan")
    # With too few poses hardly anything is known: nobody measures so few.
    end = 1e3 * plan.accuracy_m[-1]
    axis.set(ylim=(0.5 * end, _SHOWN_TIMES * end), yscale="log", title="what each pose is worth")
    axis.set(xlabel="poses", ylabel="position error left, RMS (mm)")
    label_decades(axis.yaxis)
    axis.xaxis.set_major_locator(MaxNLocator(integer=True))
    # Below the axis: the curves fill the panel.
    axis.legend(loc="upper center", bbox_to_anchor=(0.5, -0.2))


@styled
def pose_pictures(robot: Robot, plan: Plan) -> list[Figure]:
    """The robot in every pose of a plan, by its number on the sheet, with the direction of the load; one figure a page."""
    angles = robot.model_angles(np.concatenate([plan.fitted.joint_angles, plan.held_out.joint_angles]))
    force = np.concatenate([plan.fitted.force, plan.held_out.force])
    links = link_points(robot, angles).transpose(1, 0, 2)
    arms = project_view(links)
    pull = project_view(force / max(np.linalg.norm(force, axis=1).max(), 1e-9))
    middle, half = (arms.max((0, 1)) + arms.min((0, 1))) / 2, 0.53 * np.ptp(arms, axis=(0, 1)).max()
    figures = []
    for first in range(0, len(arms), _MOST_ON_PAGE):
        page = range(first, min(first + _MOST_ON_PAGE, len(arms)))
        rows = -(-len(page) // _ACROSS)
        figure, axes = panels(rows, _ACROSS, 27 * rows)
        for axis in axes.flat:
            axis.set_axis_off()
        for axis, pose in zip(axes.flat, page, strict=False):
            judged = pose >= len(plan.fitted.joint_angles)
            draw_arm(axis, links[pose], 3.0)
            axis.plot(*arms[pose][-1], "os"[judged], color=PALETTE[judged], ms=5)
            if force[pose].any():
                tip = arms[pose][-1] + _PULL * half * pull[pose]
                axis.annotate("", tip, arms[pose][-1], arrowprops={"arrowstyle": "->", "lw": 1.0})
            axis.set_title(f"{pose + 1}{' held out' if judged else ''}", fontsize=8, loc="left", pad=1)
            axis.set(xlim=middle[0] + np.array([-half, half]), ylim=middle[1] + np.array([-half, half]), aspect="equal")
        figures.append(figure)
    return figures
