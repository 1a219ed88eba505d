"""Calibrate an arm of a Motoman from touches of planes alone, and judge it by a Leica.

Usage: python benchmarks/peers/motoman_contacts.py FOLDER, a clone of
ctu-vras/multirobot-calibration at commit a20f0454, from the top of this repository.

The right arm touched two horizontal tables and a wall with the faces of an icosahedron,
whose centre is then at a constant distance from the plane. Three sets of measurements of
a laser tracker judge it, after a fit of the tracker's frame and of the reflector's offset:
a grid, other touches of the same planes, and poses all over the workspace half a year
later. The toolbox itself stored one calibration of this arm, from contacts of both arms.
"""

from __future__ import annotations

import json
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import scipy
from run import summarize

from elastocal.application.identifiability import predict_tip_error
from elastocal.campaigns.campaign import GEOMETRY, tabulate_measurements
from elastocal.campaigns.campaign_folder import read_campaign_folder
from elastocal.campaigns.holdout import number_close_points
from elastocal.campaigns.importers import PublicMeasurements, read_importers
from elastocal.campaigns.measurements import (
    tabulate_single_measurements,
)
from elastocal.campaigns.reading import read_robot
from elastocal.campaigns.writing import write_campaign
from elastocal.diagnosis.diagnose import diagnose
from elastocal.diagnosis.settings import Settings
from elastocal.fitting.cases import build_case
from elastocal.fitting.least_squares import Fit
from elastocal.fitting.model import Case, compute_residual_vectors, evaluate_conditions
from elastocal.fitting.noise import estimate_noise, fit_declared_model
from elastocal.io.documents import read_document
from elastocal.loop.loading import read_described_campaign
from elastocal.loop.whole import read_cases
from elastocal.mechanics.kinematics import compute_poses
from elastocal.validation.transfer import transfer_fit

ROBOTS = Path("config/robots")
ROBOT = "motoman_right_arm"
DATA = Path("UserData/Robots/Motoman/Dataset/leica_dataset")
STORED = Path("UserData/Results/self-touch-motoman/kin-rep1-pert1.txt")
PLANES = ("wall", "higher", "lower")
RUNS = (1, 2)
# The wall was set up anew between its two runs: repeated touches differ by 0.8 mm, those
# of the tables by 0.05 mm.
MOVED = ("wall",)
# Distance of the centre of the icosahedron from the flange (loadMotoman.m), m; a fit
# estimates it, and this value only sorts touches by place.
CENTRE_M = (0.0, 0.0, 0.354)
# Touches of one place are within this distance of each other, m; places are 0.1 m apart.
SAME_PLACE_M = 0.03
# A place that was touched fewer times determines its own height and little else.
FEWEST_TOUCHES = 3
# A plane through places of the nominal robot, which is off by a few mm in 0.4 m.
NORMAL_STD_RAD = 0.005
JOINTS = 6
REPLICATES = 1000
SEED = 1


def main(folder: Path) -> None:
    """Print a line for each model and each set of measurements of the tracker."""
    with tempfile.TemporaryDirectory() as scratch_name:
        scratch = Path(scratch_name)
        judges = read_judges(folder / DATA)
        print("model; judge; poses; RMS (95 %), mm; largest, mm")
        cases = {}
        for name, measured in judges.items():
            bound = scratch / f"{name}_bound"
            write_positions(bound, measured, ROBOT, [*GEOMETRY])
            training, held_out = read_cases(bound, ROBOTS)
            report("geometry from this Leica", name, fit(training), training, held_out)
            toolbox = scratch / f"{name}_toolbox"
            write_positions(toolbox, measured, "robot.yaml", [])
            write_stored_robot(folder / STORED, toolbox / "robot.yaml")
            case = read_whole_case(toolbox)
            report("toolbox, stored", name, fit(case), case, case)
            drawing = scratch / name
            write_positions(drawing, measured, ROBOT, [])
            cases[name] = read_whole_case(drawing)
            report("drawing", name, fit(cases[name]), cases[name], cases[name])
        for label, by_place in (("planes", False), ("places", True)):
            write_contacts(scratch / label, folder / DATA, by_place=by_place)
            contacts = read_whole_case(scratch / label)
            models = {
                f"{label}, geometry": fit(contacts),
                f"{label}, diagnosis": diagnose(contacts, Settings(), SEED).final,
            }
            for model, fitted in models.items():
                error_m = predict_tip_error(fitted, contacts.observations)
                if error_m is not None:
                    print(f"{model}; predicted by the fit itself; {1e3 * error_m:.3f}")
                for name, case in cases.items():
                    report(model, name, fitted, contacts, case)


def read_table(path: Path) -> np.ndarray:
    """Read a row (P, 26) of each pose, which repeats for each camera image."""
    rows = scipy.io.loadmat(path)["dataset"]
    return rows[np.unique(rows[:, 0], return_index=True)[1]]


def read_judges(data: Path) -> dict[str, PublicMeasurements]:
    """Read the positions of the reflector, by the name of their set."""
    read = read_importers(Path("config/public_data.yaml"))["motoman"].read
    touches = [
        read(data / f"leica_{plane}_table{run}_5x5_dataset.mat")
        for plane in PLANES
        for run in RUNS
    ]
    angles = np.concatenate([touch.angles for touch in touches])
    positions = np.concatenate([touch.positions["reflector"] for touch in touches])
    return {
        "grid": read(data / "leica_right_hand_6x6x6_dataset.mat"),
        "touches": PublicMeasurements(angles, {"reflector": positions}, {}),
        "workspace": read(data / "updated_leica_dataset.mat"),
    }


def write_stored_robot(path: Path, destination: Path) -> None:
    """Write the Denavit-Hartenberg parameters that the toolbox stored as a robot file."""
    _, _, right_arm = path.read_text(encoding="utf-8").partition("rightArm")
    lines = right_arm.splitlines()[1 : JOINTS + 2]
    lengths_m = {}
    chain = []
    for joint, line in enumerate(lines):
        a_m, d_m, alpha_rad, offset_rad = map(float, line.split()[1:])
        lengths_m |= {f"a{joint}": a_m, f"d{joint}": d_m}
        # The first row is the turntable, which stands still.
        turn = f"Rz(q{joint})" if joint else ""
        offset_deg = np.degrees(offset_rad)
        alpha_deg = np.degrees(alpha_rad)
        chain.append(
            f"{turn} Rz({offset_deg:.9f}deg) Tz(d{joint}) Tx(a{joint}) Rx({alpha_deg:.9f}deg)"
        )
    document = read_document(ROBOTS / f"{ROBOT}.yaml")
    document |= {"chain": " ".join([*chain, "[6DoF]"]), "lengths_m": lengths_m}
    destination.write_text(json.dumps(document), encoding="utf-8")


def write_positions(
    folder: Path, measured: PublicMeasurements, robot: str, declared: list[str]
) -> None:
    """Write positions of the reflector as a campaign."""
    table = tabulate_single_measurements(measured.angles, "reflector")
    table |= dict(zip("xyz", measured.positions["reflector"].T, strict=True))
    document = {
        "measured": "position",
        "frame": "tracker",
        "noise": {"position_m": 1.2e-5},
    }
    write_folder(folder, document, table, "reflector", robot, declared)


@dataclass(frozen=True)
class Touches:
    """N touches of one plane by the arm without a reflector.

    Attributes
    ----------
    angles : (N, 6) joint angles, rad.
    normal : (3,) normal of the plane through the nominal centres of the icosahedron.
    run : (N,) number of the run if the plane was moved between them; otherwise 0.
    place : (N,) number of the place that was touched.
    """

    angles: np.ndarray
    normal: np.ndarray
    run: np.ndarray
    place: np.ndarray


def read_touches(data: Path, plane: str) -> Touches:
    """Read the touches of a plane and sort them by place."""
    robot = read_robot(ROBOTS / f"{ROBOT}.yaml")
    runs = [
        read_table(data / f"no_leica_{plane}_table{run}_5x5_dataset.mat")[:, 7:13]
        for run in RUNS
    ]
    angles = np.concatenate(runs)
    coordinates = robot.chain.at(robot.model_angles(angles))
    flange_m, rotation = compute_poses(
        robot.chain, coordinates, robot.chain.end_effector
    )
    centre_m = flange_m + rotation @ np.array(CENTRE_M)
    run = np.repeat(RUNS, [len(angles) for angles in runs])
    return Touches(
        angles,
        find_normal(centre_m, flange_m),
        run if plane in MOVED else np.zeros_like(run),
        number_close_points(centre_m, SAME_PLACE_M),
    )


def write_contacts(folder: Path, data: Path, *, by_place: bool) -> None:
    """Write the touches of all planes as a campaign.

    With `by_place` each place of a plane is a plane of its own with a known normal, so
    that tables need not be flat.
    """
    angles = []
    names: list[str] = []
    features: dict[str, dict[str, Any]] = {}
    for plane in PLANES:
        touches = read_touches(data, plane)
        place = touches.place if by_place else np.zeros_like(touches.place)
        for run, number in np.unique(np.stack([touches.run, place]), axis=1).T:
            is_here = (touches.run == run) & (place == number)
            if is_here.sum() < FEWEST_TOUCHES:
                continue
            name = f"{plane}_{run}_{number}"
            features[name] = {"normal": touches.normal.tolist()}
            if by_place:
                features[name]["normal_std_rad"] = NORMAL_STD_RAD
            angles.append(touches.angles[is_here])
            names += [name] * int(is_here.sum())
    table = tabulate_single_measurements(np.concatenate(angles), "centre")
    table["feature"] = np.array(names)
    document = {"measured": "plane", "frame": "base", "features": features}
    write_folder(folder, document, table, "centre", ROBOT, [*GEOMETRY])


def find_normal(centre_m: np.ndarray, flange_m: np.ndarray) -> np.ndarray:
    """Find the normal (3,) of the plane through points (N, 3), towards the flanges."""
    normal = np.linalg.svd(centre_m - centre_m.mean(axis=0))[2][-1]
    return normal * np.sign((flange_m - centre_m).mean(axis=0) @ normal)


def write_folder(
    folder: Path,
    document: dict[str, Any],
    table: dict[str, np.ndarray],
    target: str,
    robot: str,
    declared: list[str],
) -> None:
    """Write a campaign of one target."""
    whole = {
        "campaign": folder.name,
        "robot": robot,
        "targets": {target: {"point": "6DoF", "offset_m": "unknown"}},
        "declared": declared,
        "compliance": "nominal",
        "holdout": {"fraction": 0.3, "seed": SEED},
        **document,
    }
    write_campaign(folder, whole, table, JOINTS)


def read_whole_case(folder: Path) -> Case:
    """Read the case of all poses of a campaign: nothing is held out."""
    descriptions, campaign = read_described_campaign(
        read_campaign_folder(folder, ROBOTS)
    )
    return build_case(descriptions, tabulate_measurements(campaign.measurements))


def fit(case: Case) -> Fit:
    """Fit the declared model: frames and targets, and geometry if it is declared."""
    noise, _ = estimate_noise(case)
    return fit_declared_model(case.model, case.observations, noise)


def report(model: str, judge: str, fitted: Fit, case: Case, test_case: Case) -> None:
    """Print the errors of a fit at the poses of another case."""
    transferred, estimate = transfer_fit(fitted, case, test_case)
    observations = test_case.observations
    conditions = evaluate_conditions(transferred, estimate, observations.states)
    residual = compute_residual_vectors(transferred, estimate, observations, conditions)
    errors = summarize(np.linalg.norm(residual[:, :3], axis=1), REPLICATES)
    low, high = errors.interval_mm
    rms = f"{errors.rms_mm:.3f} ({low:.3f}-{high:.3f})"
    print(
        model, judge, len(residual), rms, f"{errors.max_mm:.2f}", sep="; ", flush=True
    )


if __name__ == "__main__":
    main(Path(sys.argv[1]))
