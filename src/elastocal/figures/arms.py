"""Pictures of arms: with errors at their poses, and with a plan of poses."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.patches import Rectangle
from matplotlib.ticker import MaxNLocator

from elastocal.application.planning.cell import sample_links
from elastocal.figures.style import (
    MILLI,
    PALETTE,
    STAGES,
    add_legend_below,
    create_panels,
    label_decades,
    styled,
)
from elastocal.loop.schemas import stack_joint_angles
from elastocal.mechanics.kinematics import compute_poses

if TYPE_CHECKING:
    from collections.abc import Mapping

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from elastocal.application.planning.cell import Cell
    from elastocal.application.planning.plan import Plan
    from elastocal.io.storage import Columns
    from elastocal.mechanics.robot import Robot
    from elastocal.verdict import HeldOut

# Direction of view.
_AZIMUTH = np.radians(-60.0)
_ELEVATION = np.radians(20.0)
_ARM = "#8d9aa5"
_EDGE = "#55636e"
_SHADOW = "#e3e3e3"
_OTHER_ARMS = "#dde2e6"
_GREY = "#444444"
_MARKERS = "os"
# Magnification of the errors.
_MAGNIFICATION = 400
# Views of a plan: title, and the base axes to the right and upwards.
_VIEWS = (("from above", 0, 1), ("from the side", 0, 2))
# Largest error that the curves of a plan show, as a multiple of the final one: nobody
# measures as few poses as lead to a larger error.
_MAX_ERROR_RATIO = 30.0
# Pictures of single poses in a row and on a page.
_COLUMNS = 7
_MAX_PER_PAGE = 56
# Length of the arrow of the largest force, as a share of half the picture.
_FORCE_SHARE = 0.35


def project_view(points: np.ndarray) -> np.ndarray:
    """Project points (..., 3) in base axes, m, onto the plane of the picture.

    Returns (..., 2): coordinates to the right and upwards, m.
    """
    x, y, z = np.moveaxis(points, -1, 0)
    depth = x * np.cos(_AZIMUTH) + y * np.sin(_AZIMUTH)
    right = y * np.cos(_AZIMUTH) - x * np.sin(_AZIMUTH)
    up = z * np.cos(_ELEVATION) - depth * np.sin(_ELEVATION)
    return np.stack([right, up], axis=-1)


def draw_arm(axis: Axes, links: np.ndarray, width: float) -> None:
    """Draw a robot as thick lines along its chain, with its shadow.

    Parameters
    ----------
    axis
    links : (N, 3) array, m
        Points along the moving links in base axes.
    width : float
        Line width in points.
    """
    links = np.concatenate([np.zeros((1, 3)), links[:1] * [0.0, 0.0, 1.0], links])
    shadow = links * [1.0, 1.0, 0.0]
    for points, color, share, zorder in (
        (shadow, _SHADOW, 0.8, 0),
        (links, _EDGE, 1.0, 1),
        (links, _ARM, 0.72, 1),
    ):
        axis.plot(
            *project_view(points).T,
            color=color,
            lw=share * width,
            zorder=zorder,
            solid_capstyle="round",
            solid_joinstyle="round",
        )


@styled
def draw_arm_with_errors(robot: Robot, table: Columns, heldout: HeldOut) -> Figure:
    """Draw an arm and its held-out errors as arrows, before and after correction.

    One pose is drawn in full, the others as thin lines.

    Parameters
    ----------
    robot
    table
        Columns of the residuals table.
    heldout
        Errors of the validation poses; the titles state its RMS errors.
    """
    held_out = table["held_out"].astype(bool)
    angles = stack_joint_angles(table, robot.joints)[held_out]
    positions = np.column_stack([table[axis][held_out] for axis in "xyz"])
    arms = _compute_links(robot, np.unique(angles, axis=0))
    # Draw the arm in full that reaches farthest to a side.
    full_arm = arms[np.argmax(np.abs(project_view(arms[:, -1])[:, 0]))]
    figure, axes = create_panels(1, 2, 78, sharex=True, sharey=True)
    for axis, (stage, (label, color)) in zip(axes[0], STAGES.items(), strict=True):
        for arm in arms:
            axis.plot(*project_view(arm).T, color=_OTHER_ARMS, lw=1.2, zorder=0)
        draw_arm(axis, full_arm, 11)
        errors = np.column_stack([table[f"{stage}_d{xyz}"][held_out] for xyz in "xyz"])
        _draw_errors(axis, positions, errors, stage)
        axis.set_title(
            f"{MILLI * getattr(heldout, stage).rms_m:.2f} mm",
            fontsize=17,
            fontweight="bold",
            color=color,
            loc="left",
            pad=14,
        )
        axis.text(0, 1.015, label, transform=axis.transAxes, fontsize=9, color=_GREY)
        axis.set_aspect("equal")
        axis.set_axis_off()
        axis.margins(0.03)
    noise_mm = MILLI * (heldout.noise_floor_rms_m or np.nan)
    figure.supxlabel(
        f"RMS position error at {heldout.poses} held-out poses; "
        f"arrows: {_MAGNIFICATION} times the error; "
        f"the tracker's noise alone: {noise_mm:.2f} mm",
        fontsize=7.5,
        color=_GREY,
    )
    return figure


def _compute_links(robot: Robot, angles: np.ndarray) -> np.ndarray:
    """Points (poses, N, 3) along the links, m, at model angles (poses, n)."""
    return sample_links(robot, angles).transpose(1, 0, 2)


def _draw_errors(
    axis: Axes, positions: np.ndarray, errors: np.ndarray, stage: str
) -> None:
    """Draw magnified errors (N, 3) at positions (N, 3), m."""
    start = project_view(positions)
    tip = project_view(positions + _MAGNIFICATION * errors)
    axis.quiver(
        *start.T,
        *(tip - start).T,
        color=STAGES[stage][1],
        gid=stage,
        angles="xy",
        scale_units="xy",
        scale=1,
        width=0.005,
        zorder=3,
    )
    axis.update_datalim(tip)


@styled
def draw_plan(
    robot: Robot, cell: Cell, plan: Plan, places: Mapping[str, np.ndarray] | None = None
) -> Figure:
    """Draw the planned configurations in the cell, and the accuracy against the number
    of poses.

    Parameters
    ----------
    robot, cell, plan
        The robot, what is around it, and the configurations.
    places : mapping, optional
        Of features or a camera by name, base axes: the first three numbers are the
        position, m. The cell has a tracker only without them.
    """
    figure, axes = create_panels(1, 3, 72)
    for axis, (title, right, up) in zip(axes[0], _VIEWS, strict=False):
        _draw_plan_view(axis, robot, plan, (right, up))
        _draw_cell(axis, replace(cell, tracker_m=None) if places else cell, (right, up))
        for name, place in (places or {}).items():
            axis.plot(place[right], place[up], "^", color=PALETTE[2], ms=6, label=name)
        axis.plot(0.0, 0.0, "k+", ms=8, label="base")
        axis.set(xlabel=f"{'xyz'[right]} (m)", ylabel=f"{'xyz'[up]} (m)", title=title)
        axis.set_aspect("equal", adjustable="box")
        # A box may represent a floor without an end, so the arm sets the limits.
        fitted = robot.model_angles(plan.fitted.joint_angles)
        reach = max(np.abs(sample_links(robot, fitted)).max(), 0.1)
        shown = reach
        if cell.tracker_m is not None:
            shown = max(reach, float(np.abs(cell.tracker_m).max()))
        axis.set(xlim=(-1.1 * reach, 1.1 * shown), ylim=(-1.1 * reach, 1.1 * reach))
    _draw_accuracy(axes[0, 2], plan)
    add_legend_below(figure, 4)
    return figure


def _draw_plan_view(
    axis: Axes, robot: Robot, plan: Plan, view: tuple[int, int]
) -> None:
    """Draw the arms of a plan and their end-effectors, in a view of two base axes."""
    right, up = view
    sets = {"to fit": plan.fitted, "held out": plan.held_out}
    for number, (label, chosen) in enumerate(sets.items()):
        if not len(chosen.joint_angles):
            continue
        angles = robot.model_angles(chosen.joint_angles)
        for arm in _compute_links(robot, angles):
            axis.plot(arm[:, right], arm[:, up], color="#c8c8c8", lw=0.6, zorder=1)
        positions, _ = compute_poses(robot.chain, angles, robot.chain.end_effector)
        axis.plot(
            positions[:, right],
            positions[:, up],
            _MARKERS[number],
            color=PALETTE[number],
            ms=3.5,
            label=label,
            zorder=2,
        )


def _draw_cell(axis: Axes, cell: Cell, view: tuple[int, int]) -> None:
    """Draw the obstacles and the tracker, in a view of two base axes."""
    right, up = view
    for number, box in enumerate(cell.boxes):
        size = box[:, 1] - box[:, 0]
        rectangle = Rectangle(
            (box[right, 0], box[up, 0]),
            size[right],
            size[up],
            label="excluded" if number == 0 else None,
            facecolor="#f2d7c9",
            edgecolor=PALETTE[1],
            lw=0.6,
            zorder=0,
        )
        axis.add_patch(rectangle)
    if cell.tracker_m is not None:
        position = cell.tracker_m[right], cell.tracker_m[up]
        axis.plot(*position, "^", color=PALETTE[2], ms=6, label="tracker")


def _draw_accuracy(axis: Axes, plan: Plan) -> None:
    """Draw the predicted error against the number of poses, for the plan and for random
    poses."""
    count = np.arange(1, len(plan.accuracy_m) + 1)
    low, median, high = MILLI * np.quantile(plan.random_m, [0.05, 0.5, 0.95], axis=0)
    axis.fill_between(count, low, high, color=PALETTE[1], alpha=0.2, lw=0)
    axis.plot(
        count, median, color=PALETTE[1], label="random poses, median and 5 to 95 %"
    )
    axis.plot(count, MILLI * plan.accuracy_m, color=PALETTE[0], label="this plan")
    final = MILLI * plan.accuracy_m[-1]
    axis.set(
        ylim=(0.5 * final, _MAX_ERROR_RATIO * final),
        yscale="log",
        title="predicted accuracy",
        xlabel="fitted poses",
        ylabel="RMS position error (mm)",
    )
    label_decades(axis.yaxis)
    axis.xaxis.set_major_locator(MaxNLocator(integer=True))


@dataclass(frozen=True)
class _PoseViews:
    """The poses of a plan on one scale, fitted poses first.

    Attributes
    ----------
    links : (poses, N, 3) array, m
    force : (poses, 3) array
        Force as a share of the largest one.
    fitted : int
        Number of fitted poses; the others are held out.
    middle : (2,) array, m
        Middle of the pictures.
    half_width : float, m
        Half the width of the pictures.
    """

    links: np.ndarray
    force: np.ndarray
    fitted: int
    middle: np.ndarray
    half_width: float


@styled
def draw_poses(robot: Robot, plan: Plan) -> list[Figure]:
    """Draw the robot in every pose of a plan, with its number on the sheet and the
    direction of the load; one figure a page."""
    angles = np.concatenate([plan.fitted.joint_angles, plan.held_out.joint_angles])
    force = np.concatenate([plan.fitted.force, plan.held_out.force])
    links = _compute_links(robot, robot.model_angles(angles))
    arms = project_view(links)
    views = _PoseViews(
        links,
        force / max(np.linalg.norm(force, axis=1).max(), 1e-9),
        len(plan.fitted.joint_angles),
        (arms.max((0, 1)) + arms.min((0, 1))) / 2,
        0.53 * np.ptp(arms, axis=(0, 1)).max(),
    )
    figures = []
    for first in range(0, len(links), _MAX_PER_PAGE):
        page = range(first, min(first + _MAX_PER_PAGE, len(links)))
        rows = -(-len(page) // _COLUMNS)
        figure, axes = create_panels(rows, _COLUMNS, 27 * rows)
        for axis in axes.flat:
            axis.set_axis_off()
        for axis, pose in zip(axes.flat, page, strict=False):
            _draw_pose(axis, views, pose)
        figures.append(figure)
    return figures


def _draw_pose(axis: Axes, views: _PoseViews, pose: int) -> None:
    """Draw one pose with its number, its end-effector and its load."""
    held_out = pose >= views.fitted
    draw_arm(axis, views.links[pose], 3.0)
    end = project_view(views.links[pose])[-1]
    axis.plot(*end, _MARKERS[held_out], color=PALETTE[held_out], ms=5)
    if views.force[pose].any():
        tip = end + _FORCE_SHARE * views.half_width * project_view(views.force[pose])
        axis.annotate("", tip, end, arrowprops={"arrowstyle": "->", "lw": 1.0})
    title = f"{pose + 1} held out" if held_out else f"{pose + 1}"
    axis.set_title(title, fontsize=8, loc="left", pad=1)
    span = np.array([-views.half_width, views.half_width])
    axis.set(xlim=views.middle[0] + span, ylim=views.middle[1] + span, aspect="equal")
