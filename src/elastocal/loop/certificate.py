"""A certificate of a diagnosed campaign: how good the robot is, against what, and how sure that is."""

from __future__ import annotations

import platform
from dataclasses import asdict, dataclass, field, replace
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from elastocal.application.accuracy import REGION, campaign_poses, error_rows, predict_errors
from elastocal.application.calibrated import OperatingConditions, beyond_fitted
from elastocal.application.certificate import error_budget
from elastocal.application.compensation import find_joint_targets
from elastocal.campaigns.reading import campaign_files
from elastocal.diagnosis.misplaced import point_sentence
from elastocal.exchange.target_path import OK
from elastocal.io.records import checksum
from elastocal.random_streams import stream
from elastocal.validation.conformity import PASS, UNDECIDED, predicted_conformity
from elastocal.validation.span import joint_ranges, shortfalls

if TYPE_CHECKING:
    from collections.abc import Mapping

    import pandas as pd

    from elastocal.application.calibrated import CalibratedRobot
    from elastocal.exchange.target_path import TargetPath
    from elastocal.loop.calibrated_files import Diagnosed
    from elastocal.mechanics.robot import Robot

# Of intervals of the budget.
_DRAWS = 2000
_LIBRARIES = ("elastocal", "numpy", "scipy")
USE = "the poses and loads of its use"
_MODELS = {"frames": "uncorrected", "declared": "declared", "effect": "corrected"}
_METRICS = ("mean_m", "rms_m", "p95_m", "max_m")


@dataclass(frozen=True)
class Wanted:
    """What a certificate is to state.

    `stated`: ``measured_on`` of the campaign and the entries of its ``certificate``.
    """

    tolerance_m: float
    accepted_risk: float
    serial: str
    date: str
    seed: int
    stated: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Use:
    """Commands (N, n) with their conditions, and which of them lie beyond what was fitted (N,)."""

    reported_angles: np.ndarray
    operating: OperatingConditions
    outside: np.ndarray


def use_at(calibrated: CalibratedRobot, wanted: TargetPath) -> Use:
    """The use of a robot at wanted poses, each corrected; a pose that it cannot reach lies beyond."""
    operating = OperatingConditions(wanted.wrench, wanted.approach, wanted.time_s, wanted.temperature_c)
    found = find_joint_targets(calibrated, wanted.position, wanted.rotation, operating, wanted.start)
    joints, loads = beyond_fitted(calibrated, found.joint_angles, wanted.wrench)
    return Use(found.joint_angles, operating, joints | loads | (found.status != OK))


def certificate(
    folder: str | Path,
    robots_folder: str | Path,
    found: Diagnosed,
    wanted: Wanted,
    use: Use | None = None,
) -> dict[str, Any]:
    """Contents of a certificate.

    All of the corrected robot is predicted. `folder`, `robots_folder`: as in `reading.read_campaign`. `found`: the campaign.
    `use`: where the robot is used; without, at the poses and loads of the campaign. Returns JSON-serialisable.
    """
    calibrated, case = found.calibrated, found.case
    robot, states = calibrated.robot, case.observations.states
    poses = campaign_poses(calibrated) if use is None else (use.reported_angles, use.operating)
    prediction = predict_errors(calibrated, *poses)
    accuracy = prediction.accuracy(REGION if use is None else USE)
    decision = predicted_conformity(prediction.rms_m, accuracy.poses, wanted.tolerance_m, wanted.accepted_risk)
    judged = found.verdict["heldout"]["configurations"]
    missing = shortfalls(judged, states, robot, None if use is None else use.outside)
    if not accuracy.fitted:
        missing = ["nothing fitted: no error of 0 is predicted of a robot of which nothing was fitted", *missing]
    if missing and decision.decision == PASS:
        decision = replace(decision, decision=UNDECIDED)
    budget = error_budget(calibrated, *poses, _DRAWS, stream(wanted.seed, found.name, "certificate: budget", 0))
    uncorrected = next(share.rms_m for share in budget if share.name == "uncorrected")
    return {
        "campaign": found.name,
        "robot": robot.name,
        "serial": wanted.serial,
        "date": wanted.date,
        "stated": dict(wanted.stated),
        "versions": {name: metadata.version(name) for name in _LIBRARIES} | {"python": platform.python_version()},
        "origin": found.origin,
        "files": {Path(file).name: checksum(file) for file in campaign_files(folder, robots_folder)},
        "verdict": found.verdict["verdict"],
        "effects": [effect["name"] for effect in found.verdict["effects"]],
        "errors": error_rows(found.verdict, *([] if use is None else [(accuracy, uncorrected)])),
        "held_out": [*(_step(row) for _, row in found.errors.iterrows()), *_delivered(found.verdict)],
        "regression": (found.verdict["remainder"] or {}).get("words", ""),
        "noise_floor_rms_m": found.verdict["heldout"]["noise_floor_rms_m"],
        "accuracy": accuracy.document(),
        "point": point_sentence(case.campaign),
        "misplaced": found.verdict["misplaced"],
        "worst_pose": _worst_pose(robot, poses[0], prediction.error_m),
        "conformity": asdict(decision) | {"configurations": judged, "shortfalls": missing},
        "joint_ranges": joint_ranges(states, robot),
        "budget": [asdict(share) for share in budget],
        "budget_states": accuracy.poses,
        "tracker_rms_m": float(np.sqrt(3.0) * calibrated.noise.position_m),
    }


def _step(row: pd.Series) -> dict[str, Any]:
    """A row of before_after.csv; an end of an interval that is open is none."""

    def number(name: str) -> float | None:
        return float(row[name]) if np.isfinite(row[name]) else None

    names = [f"heldout_{metric}{end}" for metric in _METRICS for end in ("", "_low", "_high")]
    return {"model": _MODELS[row["kind"]], "step": row["step"]} | {
        name.removeprefix("heldout_"): number(name) for name in names
    }


def _delivered(verdict: Mapping[str, Any]) -> list[dict[str, Any]]:
    """The same of the final model with a regression, where there is one."""
    more = verdict["remainder"]
    if not more or not more["regression"]:
        return []
    ends = dict.fromkeys(f"{name}_{end}" for name in _METRICS for end in ("low", "high"))
    low, high = more["rms_ci95_m"]
    return [{"model": "delivered", "step": more["words"]} | more["errors"] | ends | {"rms_m_low": low, "rms_m_high": high}]


def _worst_pose(robot: Robot, reported_angles: np.ndarray, error_m: np.ndarray) -> dict[str, Any]:
    """Where the corrected robot is predicted to be worst: command in rad and m, RMS error there."""
    place = int(np.argmax(error_m))
    joints = [
        {"value": float(value), "unit": "m" if slides else "rad"}
        for value, slides in zip(reported_angles[place], robot.chain.prismatic, strict=True)
    ]
    return {"joints": joints, "error_m": float(error_m[place])}
