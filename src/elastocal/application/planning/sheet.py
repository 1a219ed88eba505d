"""A plan as a measurement sheet: a row for each measurement to make, with empty places for what the tracker reads."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from elastocal.campaigns.measurements import SHOWN, TICK
from elastocal.mechanics.components import WRENCH

if TYPE_CHECKING:
    from elastocal.application.planning.plan import Plan
    from elastocal.application.planning.survey import Survey

# From how many repeats of how many poses noise is estimated rather than declared: some sixty contrasts of positions.
REPEATED_POSES, REPEATS = 10, 4


def sheet(survey: Survey, plan: Plan) -> pd.DataFrame:
    """Rows of measurements.csv.

    Returns ``pose`` (fitted ones first, from 1), ``load`` (0 without), ``repeat``, ``target``, ``done``, empty,
    ``q1_deg..qn_deg`` (``_mm`` of prismatic joints) as the controller shows them, ``q1..qn`` the same in rad (m), wrench (N, N
    m), and ``x, y, z`` and ``rx, ry, rz``, empty. The first poses are repeated, unloaded and under the first load: each repeat
    is a fresh approach.
    """
    rows = []
    configurations = [*zip(plan.fitted.joint_angles, plan.fitted.force, strict=True)]
    fitted = len(configurations)
    configurations += zip(plan.held_out.joint_angles, plan.held_out.force, strict=True)
    endings = ["mm" if slides else "deg" for slides in survey.robot.chain.prismatic]
    for pose, (angles, force) in enumerate(configurations, 1):
        # What is typed at the controller is what is planned.
        shown = {f"q{j}_{of}": round(q / SHOWN[of], 3) + 0.0 for j, (q, of) in enumerate(zip(angles, endings, strict=True), 1)}
        exact = {name.partition("_")[0]: value * SHOWN[name.partition("_")[2]] for name, value in shown.items()}
        for repeat in range(REPEATS if pose <= min(REPEATED_POSES, fitted) else 1):
            for load, share in enumerate(survey.shares[: 2 if repeat else None]):
                # Nothing pulls where no load hangs: a share of zero has no sign.
                wrench = dict(zip((name for name, _, _ in WRENCH), (*(share * force + 0.0), 0.0, 0.0, 0.0), strict=True))
                for target in survey.targets:
                    head: dict[str, Any] = {"pose": pose, "load": load, "repeat": repeat, "target": target.name, TICK: ""}
                    rows.append(head | shown | exact | wrench)
    empty = ["x", "y", "z", *(["rx", "ry", "rz"] if survey.measured == "pose" else [])]
    return pd.DataFrame(rows).assign(**dict.fromkeys(empty, np.nan))


def campaign_document(name: str, robot_file: str, survey: Survey, plan: Plan) -> dict[str, Any]:
    """Contents of the campaign.yaml that goes with a sheet. `name`: of the campaign. `robot_file`: beside it."""
    fitted, judged = len(plan.fitted.joint_angles), len(plan.held_out.joint_angles)
    targets = {
        target.name: {"point": target.point, "offset_m": "unknown" if target.offset_m is None else list(target.offset_m)}
        for target in survey.targets
    }
    return {
        "campaign": name,
        "robot": robot_file,
        "measured": survey.measured,
        "frame": "tracker" if survey.unknown_base else "base",
        "targets": targets,
        "compliance": "identify" if survey.loaded else "nominal",
        "declared": ["joint_offset", "link_geometry"],
        "noise": {"position_m": survey.position_m}
        | ({"orientation_rad": survey.orientation_rad} if survey.measured == "pose" else {}),
        "holdout": {"poses": list(range(fitted + 1, fitted + judged + 1))},
    }
