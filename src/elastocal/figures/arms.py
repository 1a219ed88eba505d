"""Pictures of arms: with errors at their poses, and with a plan of poses."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.patches import Rectangle
from matplotlib.ticker import MaxNLocator

from elastocal.application.planning.cell import sample_links
from elastocal.figures.style import (
    PALETTE,
    STAGES,
    create_panels,
    label_decades,
    styled,
)
from elastocal.mechanics.kinematics import poses

if TYPE_CHECKING:
    from collections.abc import Mapping

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from elastocal.application.planning.cell import Cell
    from elastocal.application.planning.plan import Plan
    from elastocal.mechanics.robot import Robot
    from elastocal.verdict import HeldOut

_AZIMUTH = np.radians(-60.0)
_ELEVATION = np.radians(20.0)
_ARM = "#8d9aa5"
_EDGE = "#55636e"
_SHADOW = "#e3e3e3"
# Errors are drawn so many times larger than they are.
_TIMES = 400
# Of the curve, above its end.
_SHOWN_TIMES = 30.0
_VIEWS = (("from above", 0, 1), ("from the side", 0, 2))
# Of the pictures of single poses: how many stand in a row and on a page.
_ACROSS = 7
_MOST_ON_PAGE = 56
# A force is drawn as long as this share of the reach.
_PULL = 0.35


def project_view(points: np.ndarray) -> np.ndarray:
    """Points (..., 3) in base axes, m, in the plane of the picture, (..., 2): to the
    right and up."""
    x, y, z = np.moveaxis(points, -1, 0)
    away = x * np.cos(_AZIMUTH) + y * np.sin(_AZIMUTH)
    right = y * np.cos(_AZIMUTH) - x * np.sin(_AZIMUTH)
    return np.stack(
        [right, z * np.cos(_ELEVATION) - away * np.sin(_ELEVATION)], axis=-1
    )


def draw_arm(axis: Axes, links: np.ndarray, width: float) -> None:
    """Draw a robot as thick lines along its chain, and its shadow.

    `links` (N, 3): points along the moving links, base axes, m. `width`: of the lines,
    in points.
    """
    links = np.concatenate([np.zeros((1, 3)), links[:1] * [0.0, 0.0, 1.0], links])
    round_ends: dict[str, Any] = {"solid_capstyle": "round", "solid_joinstyle": "round"}
    axis.plot(
        *project_view(links * [1.0, 1.0, 0.0]).T,
        color=_SHADOW,
        lw=0.8 * width,
        zorder=0,
        **round_ends,
    )
    for color, share in ((_EDGE, 1.0), (_ARM, 0.72)):
        axis.plot(
            *project_view(links).T,
            color=color,
            lw=share * width,
            zorder=1,
            **round_ends,
        )


@styled
def draw_arm_with_errors(
    robot: Robot, table: Mapping[str, np.ndarray], heldout: HeldOut
) -> Figure:
    """Two panels, before and after: the arm in one of the held-out poses, and an arrow
    for each of their errors.

    `table`: columns of the residuals table. `heldout`: of verdict.json, whose RMS
    errors the titles state.
    """
    seen = table["held_out"].astype(bool)
    angles = np.column_stack(
        [table[f"q{joint}"][seen] for joint in range(1, robot.joints + 1)]
    )
    at = np.column_stack([table[axis][seen] for axis in "xyz"])
    arms = sample_links(robot, robot.model_angles(np.unique(angles, axis=0))).transpose(
        1, 0, 2
    )
    # One arm in full, the one that reaches farthest to a side; the others as thin
    # lines.
    links = arms[np.argmax(np.abs(project_view(arms[:, -1])[:, 0]))]
    figure, axes = create_panels(1, 2, 78, sharex=True, sharey=True)
    for axis, (stage, (words, color)) in zip(axes[0], STAGES.items(), strict=True):
        off = np.column_stack([table[f"{stage}_d{each}"][seen] for each in "xyz"])
        for arm in arms:
            axis.plot(*project_view(arm).T, color="#dde2e6", lw=1.2, zorder=0)
        draw_arm(axis, links, 11)
        start = project_view(at)
        tip = project_view(at + _TIMES * off)
        look: dict[str, Any] = {
            "angles": "xy",
            "scale_units": "xy",
            "scale": 1,
            "width": 0.005,
            "zorder": 3,
        }
        axis.quiver(*start.T, *(tip - start).T, color=color, gid=stage, **look)
        axis.update_datalim(tip)
        error = f"{1e3 * getattr(heldout, stage).rms_m:.2f} mm"
        axis.set_title(
            error, fontsize=17, fontweight="bold", color=color, loc="left", pad=14
        )
        axis.text(
            0, 1.015, words, transform=axis.transAxes, fontsize=9, color="#444444"
        )
        axis.set_aspect("equal")
        axis.set_axis_off()
        axis.margins(0.03)
    figure.supxlabel(
        f"RMS position error at {heldout.poses} held-out poses; arrows: {_TIMES} times the error; "
        f"the tracker's noise alone: {1e3 * (heldout.noise_floor_rms_m or np.nan):.2f} mm",
        fontsize=7.5,
        color="#444444",
    )
    return figure


@styled
def draw_plan(robot: Robot, cell: Cell, plan: Plan) -> Figure:
    """Configurations in the cell, and the accuracy against the number of poses."""
    figure, axes = create_panels(1, 3, 72)
    for axis, (words, across, up) in zip(axes[0], _VIEWS, strict=False):
        _view(axis, robot, cell, plan, across, up)
        axis.set_title(words)
    _curves(axes[0, 2], plan)
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower left", ncols=5)
    return figure


def _view(
    axis: Axes, robot: Robot, cell: Cell, plan: Plan, across: int, up: int
) -> None:
    for number, (name, some) in enumerate(
        (("to fit", plan.fitted), ("held out", plan.held_out))
    ):
        if not len(some.joint_angles):
            continue
        angles = robot.model_angles(some.joint_angles)
        for arm in sample_links(robot, angles).transpose(1, 0, 2):
            axis.plot(arm[:, across], arm[:, up], color="#c8c8c8", lw=0.6, zorder=1)
        at, _ = poses(robot.chain, angles, robot.chain.end_effector)
        axis.plot(
            at[:, across],
            at[:, up],
            "os"[number],
            color=PALETTE[number],
            ms=3.5,
            label=name,
            zorder=2,
        )
    for number, box in enumerate(cell.boxes):
        size = box[:, 1] - box[:, 0]
        look: dict[str, Any] = {
            "facecolor": "#f2d7c9",
            "edgecolor": "#D55E00",
            "lw": 0.6,
            "zorder": 0,
        }
        label = "kept out of" if number == 0 else None
        axis.add_patch(
            Rectangle(
                (box[across, 0], box[up, 0]),
                size[across],
                size[up],
                label=label,
                **look,
            )
        )
    if cell.tracker_m is not None:
        axis.plot(
            cell.tracker_m[across],
            cell.tracker_m[up],
            "^",
            color=PALETTE[2],
            ms=6,
            label="tracker",
        )
    axis.plot(0.0, 0.0, "k+", ms=8, label="base")
    axis.set(xlabel=f"{'xyz'[across]} (m)", ylabel=f"{'xyz'[up]} (m)")
    axis.set_aspect("equal", adjustable="box")
    # Boxes may stand for a floor without an end: the arm says what is shown.
    reach = max(
        np.abs(sample_links(robot, robot.model_angles(plan.fitted.joint_angles))).max(),
        0.1,
    )
    shown = (
        [reach]
        if cell.tracker_m is None
        else [reach, float(np.abs(cell.tracker_m).max())]
    )
    axis.set(xlim=(-1.1 * reach, 1.1 * max(shown)), ylim=(-1.1 * reach, 1.1 * reach))


def _curves(axis: Axes, plan: Plan) -> None:
    count = np.arange(1, len(plan.accuracy_m) + 1)
    low, middle, high = 1e3 * np.quantile(plan.random_m, [0.05, 0.5, 0.95], axis=0)
    axis.fill_between(count, low, high, color=PALETTE[1], alpha=0.2, lw=0)
    axis.plot(count, middle, color=PALETTE[1], label="random poses, 5 to 95 %")
    axis.plot(count, 1e3 * plan.accuracy_m, color=PALETTE[0], label="this plan")
    # With too few poses hardly anything is known: nobody measures so few.
    end = 1e3 * plan.accuracy_m[-1]
    axis.set(
        ylim=(0.5 * end, _SHOWN_TIMES * end),
        yscale="log",
        title="what each pose is worth",
    )
    axis.set(xlabel="poses", ylabel="position error left, RMS (mm)")
    label_decades(axis.yaxis)
    axis.xaxis.set_major_locator(MaxNLocator(integer=True))
    # Below the axis: the curves fill the panel.
    axis.legend(loc="upper center", bbox_to_anchor=(0.5, -0.2))


@styled
def draw_poses(robot: Robot, plan: Plan) -> list[Figure]:
    """The robot in every pose of a plan, by its number on the sheet, with the direction
    of the load; one figure a page."""
    angles = robot.model_angles(
        np.concatenate([plan.fitted.joint_angles, plan.held_out.joint_angles])
    )
    force = np.concatenate([plan.fitted.force, plan.held_out.force])
    links = sample_links(robot, angles).transpose(1, 0, 2)
    arms = project_view(links)
    pull = project_view(force / max(np.linalg.norm(force, axis=1).max(), 1e-9))
    middle = (arms.max((0, 1)) + arms.min((0, 1))) / 2
    half = 0.53 * np.ptp(arms, axis=(0, 1)).max()
    figures = []
    for first in range(0, len(arms), _MOST_ON_PAGE):
        page = range(first, min(first + _MOST_ON_PAGE, len(arms)))
        rows = -(-len(page) // _ACROSS)
        figure, axes = create_panels(rows, _ACROSS, 27 * rows)
        for axis in axes.flat:
            axis.set_axis_off()
        for axis, pose in zip(axes.flat, page, strict=False):
            judged = pose >= len(plan.fitted.joint_angles)
            draw_arm(axis, links[pose], 3.0)
            axis.plot(*arms[pose][-1], "os"[judged], color=PALETTE[judged], ms=5)
            if force[pose].any():
                tip = arms[pose][-1] + _PULL * half * pull[pose]
                axis.annotate(
                    "", tip, arms[pose][-1], arrowprops={"arrowstyle": "->", "lw": 1.0}
                )
            axis.set_title(
                f"{pose + 1}{' held out' if judged else ''}",
                fontsize=8,
                loc="left",
                pad=1,
            )
            axis.set(
                xlim=middle[0] + np.array([-half, half]),
                ylim=middle[1] + np.array([-half, half]),
                aspect="equal",
            )
        figures.append(figure)
    return figures
