"""The sheet of a plan: rows of measurements.csv to fill in, and the campaign.yaml that
goes with them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from elastocal.campaigns.campaign import GEOMETRY
from elastocal.campaigns.measurements import DISPLAY_UNITS, TICK_COLUMN
from elastocal.measuring.catalogue import list_kinds
from elastocal.mechanics.components import WRENCH_NAMES

if TYPE_CHECKING:
    from elastocal.application.planning.plan import Plan
    from elastocal.application.planning.survey import Survey
    from elastocal.measuring.protocol import Kind

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
    ``target``, ``feature`` if the kind has features, ``done``, empty, ``q1_deg..qn_deg``
    (``_mm`` of prismatic joints) as the controller shows them, ``q1..qn`` the same in
    rad (m), wrench (N, N m) for a tracker, and the columns of the kind, empty. A contact
    has no repeats, because each has joint angles of its own.
    """
    rows = []
    joint_angles = np.concatenate(
        [plan.fitted.joint_angles, plan.held_out.joint_angles]
    )
    forces = np.concatenate([plan.fitted.force, plan.held_out.force])
    kind = list_kinds()[survey.measured]
    repeated = _count_repeated(kind, plan)
    features = _name_features(survey, plan)
    for pose, (angles, force) in enumerate(zip(joint_angles, forces, strict=True), 1):
        feature_cells = {"feature": features[pose - 1]} if features else {}
        cells = {**feature_cells, TICK_COLUMN: "", **_format_joints(survey, angles)}
        repeats = REPEATS if pose <= repeated else 1
        of_pose = _build_rows_of_pose(survey, cells, force, repeats)
        rows += [{"pose": pose, **row} for row in of_pose]
    # A row of a contact has no numbers but the joint angles.
    empty = () if kind.is_contact else kind.columns
    return pd.DataFrame(rows).assign(**dict.fromkeys(empty, np.nan))


def _build_rows_of_pose(
    survey: Survey, cells: dict[str, Any], force: np.ndarray, repeats: int
) -> list[dict[str, Any]]:
    """Build the rows of all repeats, loads and targets of a pose.

    Parameters
    ----------
    survey : what is measured.
    cells : cells that all rows of the pose have.
    force : (3,) full load, N, base axes.
    repeats : number of approaches. All but the first have at most one load.
    """
    rows = []
    for repeat in range(repeats):
        shares = survey.shares[:2] if repeat else survey.shares
        for load, share in enumerate(shares):
            wrench_cells = {}
            if survey.setup is None:
                wrench_cells = _format_wrench(share, force)
            rows += [
                {
                    "load": load,
                    "repeat": repeat,
                    "target": target.name,
                    **cells,
                    **wrench_cells,
                }
                for target in survey.targets
            ]
    return rows


def _count_repeated(kind: Kind, plan: Plan) -> int:
    """Count the poses that are repeated. A contact is not, because each has joint angles
    of its own."""
    if kind.is_contact:
        return 0
    return min(REPEATED_POSES, len(plan.fitted.joint_angles))


def _name_features(survey: Survey, plan: Plan) -> list[str]:
    """Name the feature that is measured in each pose; empty if there are none."""
    setup = survey.setup
    if setup is None or not setup.has_features:
        return []
    assert plan.fitted.place_index is not None
    assert plan.held_out.place_index is not None
    names = list(setup.places)
    indices = np.concatenate(
        [plan.fitted.place_index, plan.held_out.place_index]
    ).tolist()
    return [names[index] for index in indices]


def clear_joint_angles(table: pd.DataFrame) -> pd.DataFrame:
    """Return the rows of a sheet with empty columns of joint angles, because only the
    joint angles at the contact count."""
    planned = [name for name in map(str, table) if name.startswith("q")]
    displayed = [name for name in planned if "_" in name]
    exact = [name for name in planned if "_" not in name]
    return table.drop(columns=displayed).assign(**dict.fromkeys(exact, np.nan))


def _format_joints(survey: Survey, angles: np.ndarray) -> dict[str, float]:
    """Return the cells of joint angles (n,): rounded as the controller shows them, and the
    same rounded values in rad and m, so that the typed angles are the planned ones."""
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
    document: dict[str, Any] = {
        "campaign": name,
        "robot": robot_file,
        "measured": survey.measured,
        "frame": "tracker" if survey.unknown_base else "base",
        "targets": targets,
        "compliance": "identify" if survey.loaded else "nominal",
        "declared": list(GEOMETRY),
    }
    # The noise of a camera depends on the pose and is estimated.
    if survey.setup is None or survey.setup.has_features:
        noise = {"position_m": survey.position_m}
        if survey.rows == 6:
            noise["orientation_rad"] = survey.orientation_rad
        document["noise"] = noise
    document["holdout"] = {"poses": list(range(fitted + 1, fitted + held_out + 1))}
    return document | _describe_setup(survey)


def _describe_setup(survey: Survey) -> dict[str, Any]:
    """Describe features, or the mounting of a camera, as campaign.yaml does."""
    setup = survey.setup
    if setup is None:
        return {}
    if not setup.has_features:
        (target,) = survey.targets
        unknown = {"point": target.point, "offset_m": "unknown", "rotation": "unknown"}
        return {
            "camera": setup.options["camera"],
            "frame": "unknown",
            "targets": {target.name: unknown},
        }
    features = {
        name: setup.kind.state_place(place) for name, place in setup.places.items()
    }
    return {"features": features}
