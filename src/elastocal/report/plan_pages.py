"""The sheet of a plan, to take to the cell: a row for each pose with a box for each measurement, pictures, what it is worth."""

from __future__ import annotations

from typing import TYPE_CHECKING

from elastocal.campaigns.measurements import SHOWN
from elastocal.counting import counted
from elastocal.report.typesetting import compile_document

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path
    from typing import Any

    import pandas as pd

    from elastocal.application.planning.plan import Plan
    from elastocal.application.planning.survey import Survey
    from elastocal.campaigns.campaign import Target

_UNITS = {"deg": "°", "mm": "mm"}


def write_plan_sheet(path: str | Path, facts: Mapping[str, Any], figures: Mapping[str, str]) -> None:
    """Typeset the sheet; the file appears whole or not at all.

    `path`: the PDF. `facts`: from `plan_facts`. `figures`: PDF files by their names, "overview" and pages of poses.
    """
    pictures = [name for name in figures if name != "overview"]
    compile_document(path, "plan.typ", {"facts": {**facts, "pictures": pictures}}, figures.values())


def plan_facts(survey: Survey, plan: Plan, rows: pd.DataFrame, worth: Sequence[str]) -> dict[str, Any]:
    """What the sheet states: sentences, the heads of the table, and for each pose its cells and how often each load is read."""
    angles = [name for name in map(str, rows) if name.startswith("q") and name.rpartition("_")[2] in SHOWN]
    heads = ["pose", *(f"{name.partition('_')[0]} ({_UNITS[name.partition('_')[2]]})" for name in angles)]
    forces = ["fx", "fy", "fz"] if survey.loaded else []
    heads += [f"F{name[1]} (N)" for name in forces] + ["measured"]
    poses = []
    for pose, part in rows.groupby("pose"):
        pulled = part[part["load"] == 1] if survey.loaded else part
        cells = [
            str(pose),
            *(f"{part[name].iloc[0]:.2f}" for name in angles),
            *(f"{round(pulled[name].iloc[0]) + 0:d}" for name in forces),
        ]
        visits = [
            {"load": _load_name(share), "count": int(part.loc[part["load"] == load, "repeat"].nunique())}
            for load, share in enumerate(survey.shares)
            if (part["load"] == load).any()
        ]
        poses.append({"cells": cells, "visits": visits})
    targets = "; ".join(_where(target) for target in survey.targets)
    many = f"In each of them measure the targets {targets}." if len(survey.targets) > 1 else f"The target is {targets}."
    fitted = len(plan.fitted.joint_angles)
    return {
        "robot": survey.robot.name,
        "lines": [
            f"{counted(fitted, 'pose')} to fit and {len(poses) - fitted} held out: {counted(len(rows), 'measurement')}.",
            many,
        ],
        "how": (
            "Tick a box for each measurement. Several boxes behind one load: move away and approach the pose afresh each time."
            + (" F is the load marked +F; −F is the opposite pull, 0 none." if survey.loaded else "")
        ),
        "heads": heads,
        "rows": poses,
        "fitted": fitted,
        "arrow": "The arrow is the direction of the load +F." if survey.loaded else "",
        "worth": " ".join(worth),
    }


def _where(target: Target) -> str:
    """A target with its measuring point and offset: the reflector has to sit there, or the robot is corrected elsewhere."""
    at = target.offset_m and ", ".join(f"{1e3 * value:.2f}" for value in target.offset_m)
    return f"{target.name} on {target.point}, " + (f"at ({at}) mm of it" if at else "at an offset that is fitted")


def _load_name(share: float) -> str:
    return {0.0: "0", 1.0: "+F", -1.0: "−F"}[share]
