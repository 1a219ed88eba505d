"""The table of docs/no_tracker_results.md: every arm of a finished run of `snakemake sockets
cameras`, and the URDFs that the authors of MUKCa calibrated, on the same held-out poses.

Usage: python benchmarks/peers/mukca.py FOLDER, a clone of
platonics-delft/kinematics_calibration at commit 05a05ab4, from the top of this repository.

All are judged by how far the ball is from its socket. By the authors' URDF that is its
distance from the mean of all poses in the socket, held out or not. The configuration that
they stored with the URDFs of Panda 6 and 7 names the front place alone; those of the other
arms name nothing.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pandas as pd
from run import summarize

from elastocal.campaigns.socket_recordings import read_recording
from elastocal.exchange.urdf import robot_from_urdf
from elastocal.io.documents import read_document
from elastocal.mechanics.kinematics import compute_poses
from elastocal.report.words import format_joints, name_effect
from elastocal.verdict import Verdict, read_verdict

CONFIGURATION = Path("config.yaml")
CAMPAIGNS = Path("config/campaigns")
REPORTS = Path("reports/loop")
HEADS = (
    "campaign",
    "held-out poses",
    "before",
    "geometry",
    "with physical effects",
    "stated",
    "as delivered",
    "authors' URDF",
)


def main(folder: Path) -> None:
    """Print a row for each campaign, RMS errors in mm with 95 % intervals."""
    print(f"| {' | '.join(HEADS)} |\n{'|---' * len(HEADS)}|")
    loop = read_document(CONFIGURATION)["loop"]
    for name in (*loop["sockets"], *loop["cameras"]):
        print(f"| {' | '.join(describe_campaign(name, folder))} |", flush=True)


def describe_campaign(name: str, folder: Path) -> list[str]:
    """Return the cells of one campaign."""
    verdict = read_verdict(REPORTS / name / "verdict.json")
    steps = pd.read_csv(REPORTS / name / "before_after.csv")
    declared = steps[steps.kind == "declared"].iloc[0]
    delivered_mm = f"{1e3 * verdict.heldout.delivered.rms_m:.3f}"
    if verdict.remainder is not None and verdict.remainder.rms_ci95_m is not None:
        delivered_mm += format_interval(*verdict.remainder.rms_ci95_m)
    return [
        name,
        str(verdict.heldout.poses),
        f"{1e3 * verdict.heldout.before.rms_m:.2f}",
        format_step(declared),
        format_step(steps.iloc[-1]),
        format_effects(verdict),
        delivered_mm,
        measure_authors(name, folder),
    ]


def format_step(step: pd.Series) -> str:
    """Format the held-out error of a model with its interval."""
    low_m, high_m = step.heldout_rms_m_low, step.heldout_rms_m_high
    return f"{1e3 * step.heldout_rms_m:.3f}{format_interval(low_m, high_m)}"


def format_interval(low_m: float, high_m: float) -> str:
    """Format an interval in mm."""
    return f" ({1e3 * low_m:.3f}-{1e3 * high_m:.3f})"


def format_effects(verdict: Verdict) -> str:
    """Name the stated effects, and mark those that the model does not adopt."""
    names = [
        name_effect(effect.name)
        + format_joints(effect.name, effect.joints)
        + ("" if effect.adopted else " (not adopted)")
        for effect in verdict.effects
    ]
    return "; ".join(names) or "none"


def measure_authors(name: str, folder: Path) -> str:
    """Measure the authors' URDF of an arm at the held-out poses of its campaign."""
    campaign = read_document(CAMPAIGNS / f"{name}.yaml")
    files = [file for file in campaign.get("files", []) if "/hole_" in file]
    arm = files[0].split("/")[0].removesuffix("_clean") if files else ""
    urdf = folder / "calibrated_urdf" / arm / "panda_calibrated.urdf"
    if not arm or not urdf.is_file():
        return "-"
    robot = robot_from_urdf(urdf, "panda_link0", "ball_link", ()).robot
    distances = []
    for file in files:
        recording = read_recording(folder / "data" / f"{file}.csv")
        angles = robot.model_angles(recording.angles)
        position, _ = compute_poses(robot.chain, angles, robot.chain.end_effector)
        distances.append(np.linalg.norm(position - position.mean(axis=0), axis=1))
    residuals = pd.read_parquet(REPORTS / name / "residuals.parquet")
    judged = residuals[residuals.held_out & ~residuals.gross_error]
    errors = summarize(np.concatenate(distances)[judged.row - 1])
    return f"{errors.rms_mm:.3f}"


if __name__ == "__main__":
    main(Path(sys.argv[1]))
