"""Whether a corrected robot keeps what is stated of its accuracy: predicted by the diagnosis, true on the plant.

True errors are those of the plant at corrected targets, without the tracker's noise: in the base's frame where the campaign
knew it, else after the best rigid placement over the random poses.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from statsmodels.stats.proportion import proportion_confint

from elastocal.application.accuracy import predict_errors
from elastocal.application.calibrated import OperatingConditions
from elastocal.application.compensation import find_joint_targets
from elastocal.application.frames import find_absorbed, placement, scope_about
from elastocal.diagnosis.diagnose import diagnose
from elastocal.diagnosis.judge import without_gross_errors
from elastocal.diagnosis.settings import Settings
from elastocal.exchange.target_path import OK
from elastocal.loop.whole import calibrated_by
from elastocal.validation.conformity import PASS, predicted_conformity
from elastocal_proof.blind.closed_loop import CAMPAIGN, LOADED, MILLING, UNLOADED, measured_cases, wanted_poses
from elastocal_proof.blind.rehearsal import hidden_robot, reached
from elastocal_proof.plant.random_numbers import stream

if TYPE_CHECKING:
    from elastocal_proof.blind.closed_loop import Wanted

FRAMES = ("base", "tracker")
# Random poses without and with load together, and a path.
RANDOM = "random"
PARTS = {RANDOM: (UNLOADED, LOADED), MILLING: (MILLING,)}
# Tolerances that a shop floor asks for, evenly on the logarithm: some robots keep them and some do not.
_TOLERANCES_M = (1.5e-5, 6e-5)
_RISK = 0.05
_STATED = ("rms_m", "rms_bound_m", "worst_m", "worst_bound_m", "form_m", "left_out_m")
# Verdicts under which one model stands for the robot.
_SETTLED = ("named", "adequate")


def stated_accuracy(
    robot_file: str | Path, robots_folder: str | Path, effect: str, seed: int, frame: str
) -> list[dict[str, Any]]:
    """One robot with one hidden defect: for each part what is predicted, bounded and decided of its error, and what it is."""
    plant, _ = hidden_robot(robot_file, seed, [effect])
    training, held_out = measured_cases(plant, robot_file, robots_folder, replace(CAMPAIGN, frame=frame), seed)
    found = diagnose(training, Settings(), seed)
    calibrated = calibrated_by(found, without_gross_errors(found, held_out)[1])
    wanted = wanted_poses(training.campaign.robot, plant, seed)
    operating = OperatingConditions(wanted.wrench)
    targets = find_joint_targets(calibrated, wanted.position, wanted.rotation, operating, wanted.start)
    good = targets.status == OK
    off = reached(plant, targets.joint_angles, wanted.wrench, seed + 1)[0] - wanted.position
    if frame != "base":
        off = _placed(off, wanted, good & (wanted.part != MILLING))
    tolerance = float(np.exp(stream(seed, "tolerance").uniform(*np.log(_TOLERANCES_M))))
    rows = []
    for part, members in PARTS.items():
        mine = good & np.isin(wanted.part, members)
        prediction = predict_errors(calibrated, targets.joint_angles[mine], operating.part(mine))
        stated, distance = prediction.accuracy(part), np.linalg.norm(off[mine], axis=1)
        decided = predicted_conformity(prediction.rms_m, stated.poses, tolerance, _RISK)
        rows.append(
            {"robot": Path(robot_file).stem, "effect": effect, "seed": seed, "frame": frame, "part": part}
            | {"verdict": found.document["verdict"], "poses": stated.poses}
            | {name: getattr(stated, name) for name in _STATED}
            | {"true_rms_m": float(np.sqrt((distance**2).mean())), "true_worst_m": float(distance.max())}
            | {"tolerance_m": tolerance, "decision": decided.decision}
        )
    return rows


def coverage(rows: pd.DataFrame) -> pd.DataFrame:
    """How often the truth is below the stated bounds, and how often it denies a pass, with Clopper-Pearson intervals.

    One row for each frame (and all), part, kind of verdict (and all) and question: ``cases, hits, share, low, high``, and the
    root of mean true over mean predicted squares.
    """
    settled = rows["verdict"].isin(_SETTLED)
    questions = {
        "rms below its 95 % bound": (settled | True, rows["true_rms_m"] <= rows["rms_bound_m"]),
        "worst below its 95 % bound": (settled | True, rows["true_worst_m"] <= rows["worst_bound_m"]),
        "pass that the truth denies": (rows["decision"] == PASS, rows["true_rms_m"] > rows["tolerance_m"]),
        "fail that the truth denies": (rows["decision"] == "fail", rows["true_rms_m"] <= rows["tolerance_m"]),
    }
    found = []
    for frame in (*FRAMES, "all"):
        for part in PARTS:
            for verdict, chosen in (("one model", settled), ("several, class, unexplained", ~settled), ("all", settled | True)):
                mine = chosen & (rows["part"] == part) & ((rows["frame"] == frame) | (frame == "all"))
                squares = [(rows.loc[mine, name] ** 2).mean() for name in ("true_rms_m", "rms_m")]
                for question, (asked, hit) in questions.items():
                    cases, hits = int((mine & asked).sum()), int((mine & asked & hit).sum())
                    low, high = proportion_confint(hits, cases, method="beta") if cases else (0.0, 1.0)
                    found.append(
                        {"frame": frame, "part": part, "verdict": verdict, "question": question, "cases": cases, "hits": hits}
                        | {"share": hits / max(cases, 1), "low": low, "high": high}
                        | {"true_over_predicted": float(np.sqrt(squares[0] / squares[1]))}
                    )
    return pd.DataFrame(found)


def _placed(off: np.ndarray, wanted: Wanted, over: np.ndarray) -> np.ndarray:
    """Errors (N, 3) less the rigid motion that explains most of some of them."""
    columns = placement(scope_about(wanted.position[over]), wanted.position, wanted.rotation)
    field = np.concatenate([off, np.zeros_like(off)], axis=1)[..., None]
    motion = find_absorbed(columns[over], field[over], np.repeat([True, True, False, False], 3))
    return (field - columns @ motion)[:, :3, 0]
