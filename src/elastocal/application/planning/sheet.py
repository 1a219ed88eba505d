"""The sheet of a plan: rows of measurements.csv to fill in, and the campaign.yaml that
goes with them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from elastocal.campaigns.campaign import GEOMETRY
from elastocal.campaigns.measurements import DISPLAY_UNITS, TICK_COLUMN
from elastocal.mechanics.components import WRENCH_NAMES

if TYPE_CHECKING:
    from elastocal.application.planning.plan import Plan
    from elastocal.application.planning.survey import Survey

# Number of poses that are repeated, and how often each is measured. The noise is
# estimated from the repeats, some sixty contrasts of positions, instead of declared.
REPEATED_POSES = 10
REPEATS = 4


def build_sheet(survey: Survey, plan: Plan) -> pd.DataFrame:
    """Build the rows of measurements.csv.

    The first poses are repeated, without load and under the first load; each repeat is
    a new approach.

    Returns
    -------
    Columns ``pose`` (fitted ones first, from 1), ``load`` (0 without), ``repeat``,
    ``target``, ``done``, empty, ``q1_deg..qn_deg`` (``_mm`` of prismatic joints) as the
    controller shows them, ``q1..qn`` the same in rad (m), wrench (N, N m), and ``x, y,
    z`` and ``rx, ry, rz``, empty.
    """
    rows = []
    joint_angles = np.concatenate(
        [plan.fitted.joint_angles, plan.held_out.joint_angles]
    )
    forces = np.concatenate([plan.fitted.force, plan.held_out.force])
    repeated = min(REPEATED_POSES, len(plan.fitted.joint_angles))
    for pose, (angles, force) in enumerate(zip(joint_angles, forces, strict=True), 1):
        joint_cells = _format_joints(survey, angles)
        for repeat in range(REPEATS if pose <= repeated else 1):
            shares = survey.shares[:2] if repeat else survey.shares
            for load, share in enumerate(shares):
                wrench_cells = _format_wrench(share, force)
                for target in survey.targets:
                    rows.append(
                        {
                            "pose": pose,
                            "load": load,
                            "repeat": repeat,
                            "target": target.name,
                            TICK_COLUMN: "",
                            **joint_cells,
                            **wrench_cells,
                        }
                    )
    empty = ["x", "y", "z"]
    if survey.measured == "pose":
        empty += ["rx", "ry", "rz"]
    return pd.DataFrame(rows).assign(**dict.fromkeys(empty, np.nan))


def _format_joints(survey: Survey, angles: np.ndarray) -> dict[str, float]:
    """Return the cells of joint angles (n,): as the controller shows them, then exactly
    these rounded values in rad and m, so that what is typed is what is planned."""
    shown = {}
    exact = {}
    joints = zip(angles, survey.robot.prismatic_commands, strict=True)
    for number, (angle, is_prismatic) in enumerate(joints, 1):
        unit = "mm" if is_prismatic else "deg"
        value = round(angle / DISPLAY_UNITS[unit], 3) + 0.0
        shown[f"q{number}_{unit}"] = value
        exact[f"q{number}"] = value * DISPLAY_UNITS[unit]
    return shown | exact


def _format_wrench(share: float, force: np.ndarray) -> dict[str, float]:
    """Return the cells of a share of a load; the sum with 0.0 turns -0.0 into 0.0."""
    wrench = (*(share * force + 0.0), 0.0, 0.0, 0.0)
    return dict(zip(WRENCH_NAMES, wrench, strict=True))


def build_campaign_document(
    name: str, robot_file: str, survey: Survey, plan: Plan
) -> dict[str, Any]:
    """Build the contents of the campaign.yaml that goes with a sheet.

    Parameters
    ----------
    name : name of the campaign.
    robot_file : name of the robot file in its folder.
    survey, plan : what is measured.
    """
    fitted = len(plan.fitted.joint_angles)
    held_out = len(plan.held_out.joint_angles)
    targets = {}
    for target in survey.targets:
        offset_m = "unknown" if target.offset_m is None else list(target.offset_m)
        described: dict[str, Any] = {"point": target.point, "offset_m": offset_m}
        if target.offset_m is not None:
            described["offset_std_m"] = target.offset_std_m
        targets[target.name] = described
    noise = {"position_m": survey.position_m}
    if survey.measured == "pose":
        noise["orientation_rad"] = survey.orientation_rad
    return {
        "campaign": name,
        "robot": robot_file,
        "measured": survey.measured,
        "frame": "tracker" if survey.unknown_base else "base",
        "targets": targets,
        "compliance": "identify" if survey.loaded else "nominal",
        "declared": list(GEOMETRY),
        "noise": noise,
        "holdout": {"poses": list(range(fitted + 1, fitted + held_out + 1))},
    }
