"""The sheet of a plan, to take to the cell: a row for each pose with a box for each
measurement, pictures, what it is worth."""

from __future__ import annotations

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
_LOADS = {0.0: "0", 1.0: "+F", -1.0: "−F"}


def plan_facts(
    survey: Survey, plan: Plan, rows: pd.DataFrame, worth: Sequence[str]
) -> dict[str, Any]:
    """What the sheet shows: names and counts, heads of the table, and for each pose its
    cells and how often a load is read."""
    angles = [
        name
        for name in map(str, rows)
        if name.startswith("q") and name.rpartition("_")[2] in DISPLAY_UNITS
    ]
    heads = [
        "pose",
        *(
            f"{name.partition('_')[0]} ({_UNITS[name.partition('_')[2]]})"
            for name in angles
        ),
    ]
    forces = ["fx", "fy", "fz"] if survey.loaded else []
    poses = []
    for pose, part in rows.groupby("pose"):
        pulled = part[part["load"] == 1] if survey.loaded else part
        cells = [str(pose), *(f"{part[name].iloc[0]:.2f}" for name in angles)]
        counts = [
            part.loc[part["load"] == load, "repeat"].nunique()
            for load in range(len(survey.shares))
        ]
        visits = [
            {"load": _LOADS[share], "count": int(n)}
            for share, n in zip(survey.shares, counts, strict=True)
            if n
        ]
        poses.append(
            {
                "cells": [
                    *cells,
                    *(f"{round(pulled[name].iloc[0]) + 0:d}" for name in forces),
                ],
                "visits": visits,
            }
        )
    fitted = len(plan.fitted.joint_angles)
    return {
        "robot": survey.robot.name,
        "targets": [_where(target) for target in survey.targets],
        "loaded": survey.loaded,
        "counts": [
            format_count(fitted, "pose"),
            f"{len(poses) - fitted}",
            format_count(len(rows), "measurement"),
        ],
        "heads": [*heads, *(f"F{name[1]} (N)" for name in forces), "measured"],
        "rows": poses,
        "fitted": fitted,
        "worth": " ".join(worth),
    }


def _where(target: Target) -> str:
    """A target with its measuring point and offset: the reflector has to sit there, or
    the robot is corrected elsewhere."""
    at = target.offset_m and ", ".join(
        f"{1e3 * value:.2f}" for value in target.offset_m
    )
    return f"{target.name} on {target.point}, " + (
        f"at ({at}) mm of it" if at else "at an offset that is fitted"
    )
