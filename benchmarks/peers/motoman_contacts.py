"""Calibrate an arm of a Motoman from contacts alone, and judge it by a Leica.

Usage: python benchmarks/peers/motoman_contacts.py FOLDER [VARIANT ...], FOLDER a clone of
ctu-vras/multirobot-calibration at commit a20f0454, from the top of this repository. A
VARIANT is "references" or one of `VARIANTS`, such as "surfaces"; all by default.

The right arm touched two horizontal tables and a wall with the faces of an icosahedron,
whose centre is then at a constant distance from the plane, and the icosahedron of the
left arm. Three sets of measurements of a laser tracker judge it, after a fit of the
tracker's frame and of the reflector's offset: a grid, other touches of the same planes,
and poses all over the workspace half a year later. The toolbox itself stored one
calibration of this arm, from contacts of both arms.
"""

from __future__ import annotations

import json
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from run import summarize

from elastocal.application.identifiability import predict_tip_error
from elastocal.campaigns.campaign import GEOMETRY, tabulate_measurements
from elastocal.campaigns.campaign_folder import read_campaign_folder
from elastocal.campaigns.holdout import number_close_points
from elastocal.campaigns.importers import (
    Importer,
    PublicMeasurements,
    read_importers,
)
from elastocal.campaigns.measurements import tabulate_single_measurements
from elastocal.campaigns.reading import read_robot
from elastocal.campaigns.writing import write_campaign
from elastocal.diagnosis.diagnose import diagnose
from elastocal.diagnosis.settings import Settings
from elastocal.fitting.cases import build_case
from elastocal.fitting.least_squares import Fit
from elastocal.fitting.model import Case, compute_residual_vectors, evaluate_conditions
from elastocal.fitting.noise import estimate_noise, fit_declared_model
from elastocal.fitting.observations import Observations
from elastocal.io.documents import read_document
from elastocal.loop.loading import read_described_campaign
from elastocal.loop.whole import read_cases
from elastocal.mechanics.kinematics import compute_poses
from elastocal.validation.transfer import transfer_fit

ROBOTS = Path("config/robots")
IMPORTERS = Path("config/public_data.yaml")
DATA = Path("UserData/Robots/Motoman/Dataset/leica_dataset")
STORED = Path("UserData/Results/self-touch-motoman/kin-rep1-pert1.txt")
PLANES = ("wall", "higher", "lower")
RUNS = (1, 2)
# Touches of one place are within this distance of each other, m; places are 0.1 m apart.
SAME_PLACE_M = 0.03
# A place that was touched fewer times determines its own height and little else.
FEWEST_TOUCHES = 3
# A plane through places of the nominal robot, which is off by a few mm in 0.4 m.
NORMAL_STD_RAD = 0.005
# Joint angles of the left arm while the tracker measured the right one, rad.
PARKED_RAD = (1.5, 0.0, 0.0, 0.0, 0.0, 0.0)
JOINTS = 6
# Argument of the command for the lines without a calibration from contacts.
REFERENCES = "references"
REPLICATES = 1000
SEED = 1


@dataclass(frozen=True)
class Variant:
    """What a calibration is made from.

    Attributes
    ----------
    label : name in the output.
    importer : importer of the contacts in ``config/public_data.yaml``.
    form : "planes" if tables and wall are flat; "places" if each place of a surface is a
        plane of its own with a known normal; "surfaces" if their forms are fitted.
    """

    label: str
    importer: str
    form: str

    def __str__(self) -> str:
        return self.label


VARIANTS = tuple(
    Variant(f"{form}{touched}", importer, form)
    for touched, importer in (
        ("", "motoman_planes"),
        (" and other arm", "motoman_contacts"),
    )
    for form in ("planes", "places", "surfaces")
)


def main(folder: Path, labels: list[str]) -> None:
    """Print a line for each model and each set of measurements of the tracker."""
    importers = read_importers(IMPORTERS)
    judges = read_judges(folder / DATA, importers["motoman"])
    print("model; judge; poses; RMS (95 %), mm; largest, mm", flush=True)
    with tempfile.TemporaryDirectory() as scratch_name:
        scratch = Path(scratch_name)
        if not labels or REFERENCES in labels:
            report_references(folder, scratch, judges)
        for variant in VARIANTS:
            if not labels or variant.label in labels:
                importer = importers[variant.importer]
                contacts = write_contacts(scratch, folder / DATA, importer, variant)
                cases = {
                    name: write_judge(scratch, f"{variant} {name}", measured, importer)
                    for name, measured in judges.items()
                }
                report_model(f"{variant}, geometry", fit(contacts), contacts, cases)
                final = diagnose(contacts, Settings(), SEED).final
                report_model(f"{variant}, diagnosis", final, contacts, cases)


def report_model(
    model: str, fitted: Fit, contacts: Case, cases: dict[str, Case]
) -> None:
    """Print the error of the tip that a fit of contacts predicts, and the errors that
    each set of measurements of the tracker shows."""
    error_m = predict_tip_error(fitted, select_tables(contacts))
    if error_m is not None:
        print(f"{model}; predicted by the fit itself; {1e3 * error_m:.3f}", flush=True)
    for name, case in cases.items():
        report(model, name, fitted, contacts, case)


def report_references(
    folder: Path, scratch: Path, judges: dict[str, PublicMeasurements]
) -> None:
    """Print lines for the drawing, the stored result of the toolbox, and the geometry
    that is fitted to the tracker itself."""
    (right_arm,) = read_importers(IMPORTERS)["motoman"].robots
    for name, measured in judges.items():
        bound = scratch / f"{name}_bound"
        write_positions(bound, measured, right_arm, [*GEOMETRY])
        training, held_out = read_cases(bound, ROBOTS)
        report("geometry from this Leica", name, fit(training), training, held_out)
        toolbox = scratch / f"{name}_toolbox"
        write_positions(toolbox, measured, "robot.yaml", [])
        write_stored_robot(folder / STORED, right_arm, toolbox / "robot.yaml")
        case = read_whole_case(toolbox)
        report("toolbox, stored", name, fit(case), case, case)
        drawing = scratch / name
        write_positions(drawing, measured, right_arm, [])
        case = read_whole_case(drawing)
        report("drawing", name, fit(case), case, case)


def read_judges(data: Path, importer: Importer) -> dict[str, PublicMeasurements]:
    """Read the positions of the reflector, by the name of their set."""
    read = importer.read
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


def write_stored_robot(path: Path, robot: str, destination: Path) -> None:
    """Write the Denavit-Hartenberg parameters that the toolbox stored as the file of a
    robot."""
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
    document = read_document(ROBOTS / f"{robot}.yaml")
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


def write_judge(
    scratch: Path, name: str, measured: PublicMeasurements, importer: Importer
) -> Case:
    """Write positions of the reflector as a campaign of the robot of an importer, and
    return its case."""
    (robot,) = importer.robots
    other_joints = read_robot(ROBOTS / f"{robot}.yaml").joints - JOINTS
    parked = np.tile(PARKED_RAD[:other_joints], (len(measured.angles), 1))
    angles = np.concatenate([parked, measured.angles], axis=1)
    folder = scratch / name.replace(" ", "_")
    write_positions(folder, measured._replace(angles=angles), robot, [])
    return read_whole_case(folder)


def write_contacts(
    scratch: Path, data: Path, importer: Importer, variant: Variant
) -> Case:
    """Write contacts as a campaign, and return the case of all of them."""
    folder = scratch / str(variant).replace(" ", "_")
    paths = [data / f"{name}.mat" for name in importer.files]
    importer.write_campaign(paths, folder, ROBOTS, folder.name)
    if variant.form == "planes":
        flatten(folder)
    elif variant.form == "places":
        split_by_place(folder)
    return read_whole_case(folder)


def flatten(folder: Path) -> None:
    """Make each surface a plane."""
    document = read_document(folder / "campaign.yaml")
    for keys in document["features"].values():
        if keys["kind"] == "surface":
            keys["kind"] = "plane"
    rewrite(folder, document, pd.read_parquet(folder / "measurements.parquet"))


def split_by_place(folder: Path) -> None:
    """Make each place of a surface a plane of its own with a known normal.

    Places and normals are those of the nominal robot.
    """
    document = read_document(folder / "campaign.yaml")
    table = pd.read_parquet(folder / "measurements.parquet")
    centre_m = locate_centres(document, table)
    whole_features = document["features"]
    features = {}
    for feature, keys in whole_features.items():
        rows = np.flatnonzero(table["feature"] == feature)
        if keys["kind"] != "surface":
            features[feature] = keys
            continue
        normal = find_normal(centre_m[rows])
        place = number_close_points(centre_m[rows], SAME_PLACE_M)
        for number in range(place.max() + 1):
            members = rows[place == number]
            name = f"{feature}_{number}"
            if len(members) < FEWEST_TOUCHES:
                name = ""
            else:
                features[name] = {
                    "kind": "plane",
                    "normal": normal.tolist(),
                    "normal_std_rad": NORMAL_STD_RAD,
                }
            table.loc[members, "feature"] = name
    document["features"] = features
    rewrite(folder, document, table[table["feature"] != ""])


def rewrite(folder: Path, document: dict[str, Any], table: pd.DataFrame) -> None:
    """Write a campaign again with other features."""
    kinds = dict.fromkeys(keys["kind"] for keys in document["features"].values())
    columns = {name: column.to_numpy() for name, column in table.items()}
    joints = sum(name.startswith("q") for name in columns)
    write_campaign(folder, document | {"measured": [*kinds]}, columns, joints)


def locate_centres(document: dict[str, Any], table: pd.DataFrame) -> np.ndarray:
    """Locate the centres (N, 3), m, of the icosahedron at all contacts of the nominal
    robot."""
    robot = read_robot(ROBOTS / f"{document['robot']}.yaml")
    angles = table.filter(regex=r"^q\d+$").to_numpy()
    coordinates = robot.chain.at(robot.model_angles(angles))
    flange_m, rotation = compute_poses(
        robot.chain, coordinates, robot.chain.end_effector
    )
    (target,) = document["targets"].values()
    return flange_m + rotation @ np.array(target["offset_m"])


def find_normal(points_m: np.ndarray) -> np.ndarray:
    """Find the normal (3,) of the plane through points (N, 3)."""
    normal: np.ndarray = np.linalg.svd(points_m - points_m.mean(axis=0))[2][-1]
    return normal


def select_tables(case: Case) -> Observations:
    """Select the contacts with tables and wall, at which one arm stands still."""
    tables = [
        index
        for index, channel in enumerate(case.campaign.measuring.channels)
        if channel.kind.name != "sphere"
    ]
    return case.select(np.isin(case.campaign.measurements.channel, tables)).observations


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
    joints = sum(name.startswith("q") for name in table)
    write_campaign(folder, whole, table, joints)


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
    main(Path(sys.argv[1]), sys.argv[2:])
