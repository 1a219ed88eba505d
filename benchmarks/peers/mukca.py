"""Calibrated geometry against the URDFs that the authors of MUKCa calibrated, on the same
held-out poses of their arms.

Usage: python benchmarks/peers/mukca.py FOLDER, a clone of
platonics-delft/kinematics_calibration at commit 05a05ab4, from the top of this repository.

Both are judged by how far the ball is from its socket. Theirs were fitted to some of the
held-out poses too: the source does not say to which, and its front places were among them.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import numpy as np
from run import summarize

from elastocal.campaigns.campaign import Measurements, tabulate_measurements
from elastocal.campaigns.campaign_folder import read_campaign_folder
from elastocal.campaigns.socket_recordings import (
    Recording,
    describe_sockets,
    find_recordings,
    read_recording,
    tabulate_recordings,
)
from elastocal.campaigns.writing import write_campaign
from elastocal.exchange.urdf import robot_from_urdf
from elastocal.fitting.cases import build_case
from elastocal.fitting.least_squares import fit_model
from elastocal.fitting.model import (
    compute_residual_vectors,
    evaluate_conditions,
)
from elastocal.fitting.noise import estimate_noise
from elastocal.loop.loading import load_campaign
from elastocal.mechanics.kinematics import compute_poses

ROBOTS = Path("config/robots")
ARMS = {
    "panda_1": "panda",
    "panda_1_with_sensor": "panda",
    "panda_2": "panda",
    "panda_3": "panda",
    "panda_3_bis": "panda",
    "panda_4": "panda",
    "panda_6": "panda",
    "panda_7": "panda",
    "kuka_14": "iiwa14",
    "dinova_1": "gen3_lite",
    "dinova_2": "gen3_lite",
}
REPLICATES = 1000


def main(folder: Path) -> None:
    """Print a line for each arm."""
    print("arm, held-out poses, geometry RMS (95 %), authors' URDF RMS, mm")
    for arm, robot in ARMS.items():
        paths = find_recordings(folder / "data" / arm)
        recordings = [read_recording(path) for path in paths]
        distance_m, held_out = fit_geometry(recordings, robot)
        ours = summarize(distance_m, REPLICATES)
        low, high = ours.interval_mm
        own = f"{ours.rms_mm:.3f} ({low:.3f}-{high:.3f})"
        urdf = folder / "calibrated_urdf" / arm / "panda_calibrated.urdf"
        theirs = "none published"
        if urdf.is_file():
            theirs_m = measure_urdf(urdf, recordings, held_out)
            theirs = f"{summarize(theirs_m, REPLICATES).rms_mm:.3f}"
        print(arm, len(distance_m), own, theirs, sep=", ", flush=True)


def fit_geometry(
    recordings: list[Recording], robot: str
) -> tuple[np.ndarray, Measurements]:
    """Fit the declared geometry; return the distances of held-out poses from their
    sockets, m, and these poses."""
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch) / "arm"
        joints = recordings[0].angles.shape[1]
        document = describe_sockets("arm", robot, recordings, f"{joints}DoF")
        write_campaign(folder, document, tabulate_recordings(recordings), joints)
        descriptions, training, held_out = load_campaign(
            read_campaign_folder(folder, ROBOTS)
        )
    case = build_case(descriptions, tabulate_measurements(training))
    validation = build_case(descriptions, tabulate_measurements(held_out))
    noise, _ = estimate_noise(case)
    fitted = fit_model(case.model, case.observations, noise)
    conditions = evaluate_conditions(
        fitted.model, fitted.estimate, validation.observations.states
    )
    residual = compute_residual_vectors(
        fitted.model, fitted.estimate, validation.observations, conditions
    )
    return np.linalg.norm(residual[:, :3], axis=1), held_out


def measure_urdf(
    urdf: Path, recordings: list[Recording], held_out: Measurements
) -> np.ndarray:
    """Return the distances of held-out poses from the mean of their socket by a URDF, m."""
    robot = robot_from_urdf(urdf, "panda_link0", "ball_link", ()).robot
    distances = {}
    for recording in recordings:
        angles = robot.model_angles(recording.angles)
        position, _ = compute_poses(robot.chain, angles, robot.chain.end_effector)
        distance = np.linalg.norm(position - position.mean(axis=0), axis=1)
        for row, value in zip(recording.angles, distance, strict=True):
            distances[tuple(row)] = value
    return np.array([distances[tuple(row)] for row in held_out.joint_angles])


if __name__ == "__main__":
    main(Path(sys.argv[1]))
