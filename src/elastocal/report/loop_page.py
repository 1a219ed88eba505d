"""The interactive page of a campaign: one HTML file that needs no network and draws on
its own canvases."""

from __future__ import annotations

import json
from importlib import resources
from typing import TYPE_CHECKING, Any

import numpy as np
from markupsafe import Markup

from elastocal.io.atomic_writes import write_text
from elastocal.loop.schemas import find_worst_measurement, stack_joint_angles
from elastocal.mechanics.kinematics import locate_corners, locate_joint_axes
from elastocal.report import words as say
from elastocal.report.typesetting import load_template

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from elastocal.io.origin import Origin
    from elastocal.io.storage import Columns
    from elastocal.mechanics.robot import Robot

# Upper bound on the measurements of a page; more are slow to rotate on a phone.
_MAX_MEASUREMENTS = 4000
# Poses in which the robot can be drawn.
_MAX_POSES = 40
# Length of the median arrow as a share of the largest extent of the measured positions.
_ARROW_SHARE = 0.03
_STAGES = ("before", "after")


def build_loop_page(
    facts: Mapping[str, Any], table: Columns, robot: Robot
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return the texts of the page of a campaign, and the data that it draws.

    Parameters
    ----------
    facts : mapping
        As `loop_facts.collect_loop_facts` returns them.
    table : mapping of (N,) arrays
        Columns of the residuals; joint angles are those of the model, not those of the
        controller.
    robot : Robot
        The robot as declared.

    Returns
    -------
    page : dict
        Texts and tables in words.
    data : dict
        JSON-serialisable: positions (m), residuals (µm), quantities to plot them
        against, and corners, joints and axes of the robot (m).
    """
    count = len(table["x"])
    shown = np.arange(count)
    if count > _MAX_MEASUREMENTS:
        # The selection is spread evenly and has the worst measurement.
        spread = _spread(count, _MAX_MEASUREMENTS - 1)
        shown = np.unique([*spread, find_worst_measurement(table)])
    selection = {name: values[shown] for name, values in table.items()}
    position = np.column_stack([selection[name] for name in "xyz"])
    residuals_um = {stage: _stack_residuals_um(selection, stage) for stage in _STAGES}
    has_changed = not np.allclose(
        residuals_um["before"], residuals_um["after"], rtol=0, atol=0.01
    )
    data = {
        "position": position.round(6).tolist(),
        **{stage: values.round(2).tolist() for stage, values in residuals_um.items()},
        "held_out": selection["held_out"].astype(bool).tolist(),
        "against": _list_quantities(selection, robot),
        **_draw_poses(selection, robot),
        "usual_factor": _scale_arrows(position, residuals_um["before"]),
        "changed": has_changed,
    }
    page = {
        **facts,
        "changed": has_changed,
        "shown": [] if len(shown) == count else [len(shown), count],
    }
    return page, data


def _draw_poses(selection: Columns, robot: Robot) -> dict[str, Any]:
    """Return the robot in some poses, the one with the largest error among them.

    Poses are in the order of their first measurement. Validation poses of another
    campaign have numbers of their own, so a pose is known by part, session and number.
    """
    keys = np.column_stack(
        [selection["held_out"], selection["session"], selection["pose"]]
    )
    _, first_rows, inverse = np.unique(
        keys, axis=0, return_index=True, return_inverse=True
    )
    pose_of_row = inverse.ravel()
    worst_pose = pose_of_row[find_worst_measurement(selection)]
    in_order = np.argsort(first_rows)
    worst_place = np.flatnonzero(in_order == worst_pose)[0]
    drawn = in_order[np.unique([*_spread(len(first_rows), _MAX_POSES), worst_place])]
    rows = first_rows[drawn]
    angles = stack_joint_angles(selection, robot.joints)[rows]
    outlines = locate_corners(robot.chain, angles).swapaxes(0, 1)
    axes = np.moveaxis(locate_joint_axes(robot.chain, angles), 2, 0)
    return {
        "outlines": outlines.round(4).tolist(),
        "joints": axes.round(4).tolist(),
        "worst": int(np.flatnonzero(drawn == worst_pose)[0]),
        "poses": [
            f"{selection['pose'][row]}"
            + (", validation" if selection["held_out"][row] else "")
            for row in rows
        ],
        "targets": [
            _find_target_rows(selection, np.flatnonzero(pose_of_row == pose))
            for pose in drawn
        ],
    }


def _find_target_rows(selection: Columns, rows: np.ndarray) -> list[int]:
    """Return the first of some rows for each target."""
    first = np.unique(selection["target"][rows], return_index=True)[1]
    target_rows: list[int] = rows[first].tolist()
    return target_rows


def _stack_residuals_um(selection: Columns, stage: str) -> np.ndarray:
    """Return the position residuals (N, 3) of a stage, µm."""
    components = [selection[f"{stage}_d{axis}"] for axis in "xyz"]
    return say.MICRO * np.column_stack(components)


def _scale_arrows(position: np.ndarray, residual_um: np.ndarray) -> float:
    """Return the magnification at which the median arrow has its usual length."""
    median_m = np.median(np.linalg.norm(residual_um, axis=1)) / say.MICRO
    extent_m = np.ptp(position, axis=0).max()
    return float(_ARROW_SHARE * extent_m / max(median_m, 1e-9))


def write_loop_page(
    path: str | Path,
    page: Mapping[str, Any],
    data: Mapping[str, Any],
    origin: Origin | None = None,
) -> None:
    """Write the page of a campaign as an atomic write.

    Parameters
    ----------
    path : str or path
        The HTML file.
    page, data : mapping
        As `loop_page` returns them.
    origin : Origin, optional
        Named at the foot of the page.
    """
    script = (
        resources.files(__package__).joinpath("loop.js").read_text(encoding="utf-8")
    )
    # Texts come from files of other people. So they are escaped, and nothing in the data
    # can end the script that contains it.
    numbers = json.dumps(data, allow_nan=False).replace("<", "\\u003c")
    text = load_template("loop.html", say.FILTERS).render(
        page=page, origin=origin, data=Markup(numbers), script=Markup(script)
    )
    write_text(path, text)


def _spread(count: int, limit: int) -> np.ndarray:
    """Return at most `limit` indices below `count`, evenly spread."""
    indices = np.linspace(0, count - 1, min(count, limit))
    return np.unique(indices.round().astype(int))


def _list_quantities(selection: Columns, robot: Robot) -> list[dict[str, Any]]:
    """Return the quantities that vary, to plot residuals against."""
    angles = stack_joint_angles(selection, robot.joints)
    quantities = []
    for joint, is_prismatic in enumerate(robot.chain.prismatic):
        if is_prismatic:
            quantities.append((f"joint {joint + 1}", "m", angles[:, joint]))
        else:
            degrees = np.degrees(angles[:, joint])
            quantities.append((f"angle of joint {joint + 1}", "°", degrees))
    forces = np.column_stack([selection[f"f{axis}"] for axis in "xyz"])
    quantities.append(("force", "N", np.linalg.norm(forces, axis=1)))
    for axis in "xyz":
        quantities.append((f"force along {axis}", "N", selection[f"f{axis}"]))
    for axis in "xyz":
        quantities.append((f"position {axis}", "m", selection[axis]))
    quantities.append(("order of measurement", "row", selection["row"]))
    if "time_s" in selection:
        quantities.append(("time", "s", selection["time_s"]))
    varying = []
    for name, unit, values in quantities:
        if np.isfinite(values).all() and np.ptp(values) > 0:
            # Five significant digits suffice for a plot.
            rounded = [float(f"{value:.5g}") for value in values]
            varying.append({"name": name, "unit": unit, "values": rounded})
    return varying
