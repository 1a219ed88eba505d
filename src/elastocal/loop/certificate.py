"""A certificate of a diagnosed campaign: how good the robot is, against what, and how sure that is."""

from __future__ import annotations

import platform
from dataclasses import asdict, dataclass, field, replace
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from elastocal.application.accuracy import REGION, campaign_poses, error_rows, predict_errors
from elastocal.application.certificate import error_budget
from elastocal.campaigns.reading import campaign_files
from elastocal.diagnosis.misplaced import point_sentence
from elastocal.io.records import checksum
from elastocal.validation.conformity import PASS, UNDECIDED, joint_ranges, predicted_conformity, shortfalls

if TYPE_CHECKING:
    from collections.abc import Mapping

    from elastocal.loop.calibrated_files import Diagnosed
    from elastocal.mechanics.robot import Robot

_LIBRARIES = ("elastocal", "numpy", "scipy")


@dataclass(frozen=True)
class Wanted:
    """What a certificate is to state; `stated`: ``measured_on`` of the campaign and the entries of its ``certificate``."""

    tolerance_m: float
    accepted_risk: float
    serial: str
    date: str
    stated: Mapping[str, str] = field(default_factory=dict)


def certificate(folder: str | Path, robots_folder: str | Path, found: Diagnosed, wanted: Wanted) -> dict[str, Any]:
    """Contents of a certificate: all of the corrected robot is predicted, at the poses and loads of the campaign.

    `folder`, `robots_folder`: as in `reading.read_campaign`. `found`: the campaign. Returns JSON-serialisable.
    """
    calibrated, verdict = found.calibrated, found.verdict
    robot, states, poses = calibrated.robot, found.case.observations.states, campaign_poses(calibrated)
    prediction = predict_errors(calibrated, *poses)
    accuracy = prediction.accuracy(REGION)
    decision = predicted_conformity(prediction.rms_m, accuracy.poses, wanted.tolerance_m, wanted.accepted_risk)
    heldout = verdict["heldout"]
    judged = heldout["configurations"]
    missing = shortfalls(judged, states, robot)
    if not accuracy.fitted:
        missing = ["nothing fitted: no error of 0 is predicted of a robot of which nothing was fitted", *missing]
    if missing and decision.decision == PASS:
        decision = replace(decision, decision=UNDECIDED)
    return {
        "campaign": found.name,
        "robot": robot.name,
        "serial": wanted.serial,
        "date": wanted.date,
        "stated": dict(wanted.stated),
        "versions": {name: metadata.version(name) for name in _LIBRARIES} | {"python": platform.python_version()},
        "origin": found.origin,
        "files": {Path(file).name: checksum(file) for file in campaign_files(folder, robots_folder)},
        "verdict": verdict["verdict"],
        "repeatable": verdict["repeatable"],
        "effects": [effect["name"] for effect in verdict["effects"]],
        "errors": error_rows(verdict),
        "validation_rms_m": {"uncorrected": heldout["uncalibrated"]["rms_m"], "corrected": heldout["delivered"]["rms_m"]},
        "regression": (verdict["remainder"] or {}).get("words", ""),
        "noise_floor_rms_m": heldout["noise_floor_rms_m"],
        "accuracy": accuracy.document(),
        "point": point_sentence(found.case.campaign),
        "misplaced": verdict["misplaced"],
        "worst_pose": _worst_pose(robot, poses[0], prediction.error_m),
        "conformity": asdict(decision) | {"configurations": judged, "shortfalls": missing},
        "joint_ranges": joint_ranges(states, robot),
        "budget": [{"name": name, "rms_m": rms} for name, rms in error_budget(calibrated, *poses).items()],
        "budget_states": accuracy.poses,
        "tracker_rms_m": float(np.sqrt(3.0) * calibrated.noise.position_m),
    }


def _worst_pose(robot: Robot, reported_angles: np.ndarray, error_m: np.ndarray) -> dict[str, Any]:
    """Where the corrected robot is predicted to be worst: command in rad and m, RMS error there."""
    place = int(np.argmax(error_m))
    joints = [
        {"value": float(value), "unit": "m" if slides else "rad"}
        for value, slides in zip(reported_angles[place], robot.chain.prismatic, strict=True)
    ]
    return {"joints": joints, "error_m": float(error_m[place])}
