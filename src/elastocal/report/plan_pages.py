"""The sheet of a plan for the robot cell: a row for each pose with a box for each
measurement, pictures, and the expected accuracy."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from elastocal.campaigns.measurements import DISPLAY_UNITS
from elastocal.counting import format_count

if TYPE_CHECKING:
    from collections.abc import Sequence
    from typing import Any

    import pandas as pd

    from elastocal.application.planning.plan import Plan
    from elastocal.application.planning.survey import Survey
    from elastocal.campaigns.campaign import Target

_UNITS = {"deg": "°", "mm": "mm"}
# How a load is written on the sheet, by its share of the full force.
_LOAD_NAMES = {0.0: "0", 1.0: "+F", -1.0: "−F"}


def collect_plan_facts(
    survey: Survey, plan: Plan, rows: pd.DataFrame, worth: Sequence[str]
) -> dict[str, Any]:
    """Return the facts of the sheet of a plan.

    Parameters
    ----------
    survey : Survey
        The robot, its targets and loads.
    plan : Plan
        The poses.
    rows : pd.DataFrame
        One row for each measurement, as `build_sheet` returns them.
    worth : sequence of str
        Sentences on the expected accuracy.

    Returns
    -------
    dict
        Names and counts, the heads of the table, and for each pose its cells and the
        number of measurements under each load.
    """
    angle_columns = _list_angle_columns(rows)
    force_columns = ["fx", "fy", "fz"] if survey.loaded and survey.pulled else []
    heads = ["pose", *map(_name_angle, angle_columns)]
    heads += [f"F{name[1]} (N)" for name in force_columns]
    # People hang masses, not forces.
    hanging = [_format_hanging_mass(survey)] if survey.hanging else []
    heads += ["hang (kg)"] * len(hanging)
    feature_columns = ["feature"] if "feature" in rows else []
    heads += feature_columns
    poses = []
    for pose, measurements in rows.groupby("pose"):
        cells = _format_pose(pose, measurements, angle_columns, force_columns)
        features = [measurements[name].iloc[0] for name in feature_columns]
        visits = _count_visits(survey, measurements)
        poses.append({"cells": [*cells, *hanging, *features], "visits": visits})
    fitted = len(plan.fitted.joint_angles)
    return {
        "robot": survey.robot.name,
        "targets": [_describe_target(target) for target in survey.targets],
        "contact": survey.setup is not None and survey.setup.kind.is_contact,
        "loaded": survey.loaded,
        "hanging": survey.hanging,
        "counts": [
            format_count(fitted, "pose"),
            f"{len(poses) - fitted}",
            format_count(len(rows), "measurement"),
        ],
        "heads": [*heads, "measured"],
        "rows": poses,
        "fitted": fitted,
        "worth": " ".join(worth),
    }


def _list_angle_columns(rows: pd.DataFrame) -> list[str]:
    """List the columns with joint angles as the controller shows them, such as
    q1_deg."""
    return [
        name
        for name in map(str, rows)
        if name.startswith("q") and name.rpartition("_")[2] in DISPLAY_UNITS
    ]


def _name_angle(column: str) -> str:
    """Name a joint angle in the head of a table with its unit."""
    joint, _, unit = column.partition("_")
    return f"{joint} ({_UNITS[unit]})"


def _format_pose(
    pose: object,
    measurements: pd.DataFrame,
    angle_columns: Sequence[str],
    force_columns: Sequence[str],
) -> list[str]:
    """Return number, joint coordinates and full force of a pose as cells."""
    cells = [str(pose)]
    cells += [f"{measurements[name].iloc[0]:.2f}" for name in angle_columns]
    # Load 1 is the full force; adding zero removes the sign of a negative zero.
    full_load = measurements[measurements["load"] == 1]
    cells += [f"{round(full_load[name].iloc[0]) + 0:d}" for name in force_columns]
    return cells


def _format_hanging_mass(survey: Survey) -> str:
    """Return the mass, kg, whose weight is the full load."""
    gravity = math.hypot(*survey.robot.gravity_m_s2)
    return f"{survey.force_N / gravity:.2f}"


def _count_visits(survey: Survey, measurements: pd.DataFrame) -> list[dict[str, Any]]:
    """Return how often a pose is measured under each load."""
    visits = []
    for load, share in enumerate(survey.shares):
        is_loaded = measurements["load"] == load
        count = measurements.loc[is_loaded, "repeat"].nunique()
        if count:
            visits.append({"load": _LOAD_NAMES[share], "count": int(count)})
    return visits


def _describe_target(target: Target) -> str:
    """Return a target with its measuring point and offset.

    The reflector has to sit there; otherwise the robot is corrected for another point.
    """
    if not target.offset_m:
        return f"{target.name} on point {target.point}, at an unknown offset, which is fitted"
    offset = ", ".join(f"{1e3 * value:.2f}" for value in target.offset_m)
    return f"{target.name} on point {target.point}, at the offset ({offset}) mm"
