"""Campaigns without a tracker of a simulated UR10 with offsets in three joints."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from elastocal.campaigns.campaign import tabulate_measurements
from elastocal.campaigns.campaign_folder import read_campaign_folder
from elastocal.campaigns.reading import read_robot
from elastocal.campaigns.writing import write_campaign
from elastocal.fitting.cases import build_case
from elastocal.fitting.least_squares import fit_model
from elastocal.fitting.noise import estimate_noise
from elastocal.loop.loading import load_campaign
from elastocal.mechanics.kinematics import compute_point_poses
from elastocal_proof.plant.contacts import Workshop, touch_plane

ROBOTS = Path(__file__).resolve().parents[2] / "config" / "robots"
# Errors of the zeros of the joints, rad, and the tool in the frame of the flange, m.
OFFSETS_RAD = np.array([0.0, 2e-3, -3e-3, 1.5e-3, -2e-3, 0.0])
TOOL_M = (0.02, 0.03, 0.15)


def read_ur10():
    """The UR10 of this project."""
    return read_robot(ROBOTS / "ur10.yaml")


def open_workshop(seed, offsets=OFFSETS_RAD, limits=1.6):
    """A workshop with a UR10 whose joints have errors of their zeros."""
    chain = read_ur10().chain
    point = replace(chain.end_effector, offset_m=TOOL_M)

    def locate(angles):
        position, rotation = compute_point_poses(
            chain, chain.at(angles + offsets), [point]
        )
        return position[0], rotation[0]

    middle = np.array([0.3, -1.2, 1.4, -0.6, 0.4, 0.0])
    joint_limits = np.column_stack([middle - limits, middle + limits])
    return Workshop(locate, joint_limits, np.random.default_rng(seed))


def spread_places(workshop, count):
    """Places (count, 3), m, that the robot reaches in the middle of its range."""
    middle = workshop.joint_limits.mean(axis=1)
    steps = np.array([[0.0] * 6, [0.5, 0.1, 0.1, 0, 0, 0], [-0.4, 0.2, -0.3, 0, 0, 0]])
    return workshop.locate(middle + steps[:count])[0]


def touch_crossing_planes(workshop, touches, noise_m):
    """Rows of so many touches of each of three planes at right angles through one place,
    and the planes as features of a campaign."""
    (place,) = spread_places(workshop, 1)
    rows = []
    for number, normal in enumerate(np.eye(3)):
        for _ in range(touches):
            angles = touch_plane(workshop, normal, normal @ place, noise_m)
            rows.append({"angles": angles, "feature": f"plane{number}"})
    return rows, {f"plane{number}": {} for number in range(3)}


def write_contacts(folder, document, rows, robots=ROBOTS):
    """Write a campaign whose rows are dictionaries with ``angles`` and columns."""
    folder.parent.mkdir(parents=True, exist_ok=True)
    end = read_ur10().chain.end_effector.name
    whole = {
        "campaign": "contacts",
        "robot": "ur10",
        "frame": "base",
        "targets": {"tip": {"point": end, "offset_m": "unknown"}},
        "declared": ["joint_offset"],
        "holdout": {"fraction": 0.2, "seed": 1},
        **document,
    }
    table = {
        "pose": np.arange(len(rows)),
        "load": np.zeros(len(rows), int),
        "repeat": np.zeros(len(rows), int),
        "target": ["tip"] * len(rows),
    }
    angles = np.array([row["angles"] for row in rows])
    table |= {f"q{joint}": column for joint, column in enumerate(angles.T, 1)}
    names = dict.fromkeys(name for row in rows for name in row if name != "angles")
    for name in names:
        empty = "" if name in ("kind", "feature") else 0.0
        table[name] = [row.get(name, empty) for row in rows]
    write_campaign(folder, whole, table, angles.shape[1], "csv")
    return read_campaign_folder(folder, robots)


def build_contact_case(folder):
    """The case of the fitted poses of a written campaign."""
    descriptions, training, _ = load_campaign(folder)
    return build_case(descriptions, tabulate_measurements(training))


def fit_contacts(folder):
    """Fit the declared model of a written campaign, with the noise that it declares."""
    case = build_contact_case(folder)
    noise, _ = estimate_noise(case)
    return fit_model(case.model, case.observations, noise)


def count_std_errors(fitted, offsets=OFFSETS_RAD):
    """By how many standard errors each identified joint offset is off, (k,) array."""
    deviations = []
    for joint, offset in enumerate(offsets, 1):
        (index,) = fitted.parameter_indices(f"joint_offset@{joint}")
        (value,), _ = fitted.effect_values(f"joint_offset@{joint}")
        variance = fitted.covariance[index, index]
        if variance > 0.0:
            deviations.append((value - offset) / np.sqrt(variance))
    return np.array(deviations)


def check_recovery(folder, document, rows):
    """Check that a fit of a campaign recovers the joint offsets and the tool."""
    fitted = fit_contacts(write_contacts(folder, document, rows))
    assert fitted.converged
    # Four offsets are identifiable: 4 standard errors are exceeded in 1 of 4,000 fits.
    deviations = count_std_errors(fitted)
    assert len(deviations) == 4
    assert np.abs(deviations).max() < 4.0
    np.testing.assert_allclose(fitted.estimate.target_offset[0], TOOL_M, atol=3e-4)
