"""How well contacts with wavy tables calibrate a robot, and whether the fit knows it.

A simulated UR10 with errors of its geometry, which the campaign declares, touches 25
places on each of three tables, three times each. The same contacts are fitted as planes,
as a plane of its own for each place, with a known normal, and as surfaces. The true error
of the tip at these contacts, after the best placement of base and tool, is compared with
the one that the fit predicts. `python benchmarks/wavy_planes.py CASES SEED` prints a row
for each kind of table and each model.
"""

from __future__ import annotations

import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from common import ROBOTS
from instruments import ARM, MIDDLE_RAD, NORMALS, open_workshop

from elastocal.application.identifiability import predict_tip_error
from elastocal.campaigns.campaign import GEOMETRY, tabulate_measurements
from elastocal.campaigns.campaign_folder import read_campaign_folder
from elastocal.campaigns.measurements import tabulate_single_measurements
from elastocal.campaigns.writing import write_campaign
from elastocal.fitting.cases import build_case
from elastocal.fitting.model import Case, compute_residuals, evaluate_conditions
from elastocal.fitting.noise import estimate_noise, fit_declared_model
from elastocal.loop.loading import read_described_campaign
from elastocal.validation.transfer import transfer_fit
from elastocal_proof.plant.contacts import Workshop, draw_form, touch_surface

# Distance of the places from the middle of a table along both of its sides, m.
GRID_M = np.linspace(-0.2, 0.2, 5)
TOUCHES = 3
# How exactly a contact repeats, and the errors of the form of a table and the distance
# over which it changes: a table of float glass, ordinary ones, and rough ones, m.
NOISE_M = 3e-5
TABLES_M = {
    "flat": (0.0, 0.1),
    "long waves": (3e-4, 0.2),
    "waves": (3e-4, 0.1),
    "short waves": (3e-4, 0.05),
    "small waves": (1e-4, 0.1),
}
NORMAL_STD_RAD = 0.005
MODELS = ("planes", "places", "surfaces")


def main(cases: int, seed: int) -> None:
    """Print errors of all tables and models."""
    print("table; model; true RMS error of the tip, mm; predicted, mm;", end=" ")
    print("ratio: median, 90 %, largest")
    for table in TABLES_M:
        errors_m = np.array(
            [simulate_case(seed + number, table) for number in range(cases)]
        )
        for number, model in enumerate(MODELS):
            true_m, predicted_m = errors_m[:, number].T
            ratio = true_m / predicted_m
            rms_mm = 1e3 * np.sqrt((errors_m[:, number] ** 2).mean(axis=0))
            spread = [np.median(ratio), np.quantile(ratio, 0.9), ratio.max()]
            numbers = [*(f"{value:.3f}" for value in rms_mm)]
            numbers += [", ".join(f"{value:.2f}" for value in spread)]
            print(table, model, *numbers, sep="; ", flush=True)


def simulate_case(seed: int, table: str) -> list[tuple[float, float]]:
    """Return the true and the predicted error of the tip, m, of each model."""
    workshop = open_workshop(seed, [])
    angles, features = touch_tables(workshop, *TABLES_M[table])
    with TemporaryDirectory() as scratch:
        tracked = read_case(Path(scratch, "tracked"), write_positions, workshop, angles)
        return [
            judge(
                read_case(Path(scratch, model), write_contacts, angles, features),
                tracked,
            )
            for model in MODELS
        ]


def touch_tables(
    workshop: Workshop, form_m: float, length_m: float
) -> tuple[np.ndarray, np.ndarray]:
    """Touch places of three tables; return joint angles (N, 6), and table and place
    (N, 2) of each contact."""
    middle = workshop.find_tool(MIDDLE_RAD)[0]
    angles = []
    touched = []
    for number, normal in enumerate(NORMALS):
        form = draw_form(workshop.draws, form_m, length_m)
        sides = np.linalg.svd(normal[None])[2][1:]
        corners = np.stack(np.meshgrid(GRID_M, GRID_M), axis=-1).reshape(-1, 2)
        for place, offset in enumerate(corners @ sides):
            for _ in range(TOUCHES):
                angles.append(
                    touch_surface(workshop, middle + offset, normal, form, NOISE_M)
                )
                touched.append((number, place))
    return np.array(angles), np.array(touched)


def write_contacts(folder: Path, angles: np.ndarray, touched: np.ndarray) -> None:
    """Write contacts as a campaign of the model that the folder is named after."""
    features: dict[str, dict[str, Any]] = {}
    names = []
    for number, place in touched.tolist():
        name = f"table{number}"
        keys: dict[str, Any] = {"normal": NORMALS[number].tolist()}
        if folder.name == "places":
            name = f"{name}_{place}"
            keys["normal_std_rad"] = NORMAL_STD_RAD
        features[name] = keys
        names.append(name)
    table = tabulate_single_measurements(angles, "tip")
    table["feature"] = np.array(names)
    kind = "surface" if folder.name == "surfaces" else "plane"
    document = {"measured": kind, "frame": "base", "features": features}
    write_folder(folder, document, table)


def write_positions(folder: Path, workshop: Workshop, angles: np.ndarray) -> None:
    """Write the true positions of the tip as those of a tracker."""
    table = tabulate_single_measurements(angles, "tip")
    table |= dict(zip("xyz", workshop.locate(angles)[0].T, strict=True))
    document = {"measured": "position", "frame": "tracker"}
    write_folder(folder, document | {"noise": {"position_m": 1e-5}}, table)


def write_folder(
    folder: Path, document: dict[str, Any], table: dict[str, np.ndarray]
) -> None:
    """Write a campaign of the tip."""
    whole = {
        "campaign": folder.name,
        "robot": ARM,
        "targets": {"tip": {"point": "6DoF", "offset_m": "unknown"}},
        "declared": [] if document["measured"] == "position" else [*GEOMETRY],
        "compliance": "nominal",
        "holdout": {"fraction": 0.3, "seed": 1},
        **document,
    }
    write_campaign(folder, whole, table, 6)


def read_case(folder: Path, write: Any, *arguments: Any) -> Case:
    """Write a campaign and return the case of all its poses."""
    write(folder, *arguments)
    descriptions, campaign = read_described_campaign(
        read_campaign_folder(folder, ROBOTS)
    )
    return build_case(descriptions, tabulate_measurements(campaign.measurements))


def judge(contacts: Case, tracked: Case) -> tuple[float, float]:
    """Fit contacts, and return the true and the predicted error of the tip, m."""
    noise, _ = estimate_noise(contacts)
    fitted = fit_declared_model(contacts.model, contacts.observations, noise)
    transferred, estimate = transfer_fit(fitted, contacts, tracked)
    observations = tracked.observations
    conditions = evaluate_conditions(transferred, estimate, observations.states)
    residual = compute_residuals(transferred, estimate, observations, conditions)
    true_m = float(np.sqrt((residual**2).sum(axis=1).mean()))
    predicted_m = predict_tip_error(fitted, contacts.observations)
    assert predicted_m is not None
    return true_m, predicted_m


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
