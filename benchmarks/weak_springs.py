"""How often a diagnosis states impossible springs or masses, or false names, where
loads hardly show them.

Simulated robots of `elastocal_proof.plant`, which share no code with the fitted model:
the file states masses and no compliances, as from a URDF. Nothing is wrong with
the robot but its springs and its weights within that uncertainty. Forces are a few
hundredths of what the arm carries, at few poses. `python benchmarks/weak_springs.py
CASES FIRST_SEED [ROBOT...]` prints a row for each robot: campaigns with a negative
spring or mass, with a false name of 65 % or more, with effects adopted, and the median
error of the corrected robot over that before.
"""

import json
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import yaml
from common import ROBOTS
from rates import make_parser

from elastocal.campaigns.writing import write_campaign
from elastocal.diagnosis.diagnose import diagnose
from elastocal.diagnosis.judge import judge
from elastocal.diagnosis.settings import Settings
from elastocal.loop.whole import read_cases
from elastocal_proof.plant.arm import read_arm
from elastocal_proof.plant.campaigns import (
    Design,
    draw_schedule,
    simulate_measurements,
)
from elastocal_proof.plant.simulated_robot import SimulatedRobot, draw_specimen

ARMS = ("kuka", "gp180", "iiwa14", "panda")
FALSE_NAME = 0.65


def declare_masses(robot_file: Path) -> dict[str, Any]:
    """Return the file of the robot with masses and without springs; an
    arm without declared masses gets those that are typical of its size."""
    document = yaml.safe_load(robot_file.read_text(encoding="utf-8"))
    document.pop("compliance_urad_per_Nm", None)
    document.pop("links", None)
    document["masses"] = [
        {
            "link": mass.link,
            "mass_kg": mass.mass_kg,
            "centre_m": list(mass.centre_m),
            "relative_std": mass.relative_std,
        }
        for mass in read_arm(robot_file).masses
    ]
    return document


def write_simulated_campaign(
    folder: Path, robot: SimulatedRobot, design: Design, seed: int
) -> None:
    """Write the campaign of a simulated robot, without the file of the robot."""
    arm = robot.arm
    table = simulate_measurements(robot, design, draw_schedule(arm, design, seed))
    point = arm.points[-1]
    document = {
        "campaign": folder.name,
        "robot": "robot.yaml",
        "measured": design.measured,
        "frame": "base",
        "targets": {point: {"point": point, "offset_m": [0, 0, 0]}},
        "compliance": "identify",
        "declared": [],
        "holdout": {"poses": list(range(design.poses - design.held_out, design.poses))},
    }
    write_campaign(folder, document, table, arm.joints, "csv")


def measure(folder: Path, name: str, seed: int) -> None:
    """Write the campaign of a simulated robot that is hardly loaded."""
    draws = np.random.default_rng([seed, 63])
    robot_file = ROBOTS / f"{name}.yaml"
    arm = read_arm(robot_file)
    design = Design(
        poses=int(draws.integers(22, 34)),
        held_out=8,
        force_times=float(10.0 ** draws.uniform(-2.5, -1.0)),
        ladder=(0.0, 1.0),
        repeats=2,
        repeated_poses=4,
        points=(arm.points[-1],),
        covariates=(),
        measured="position",
    )
    write_simulated_campaign(folder, draw_specimen(arm, seed), design, seed)
    (folder / "robot.yaml").write_text(
        yaml.safe_dump(declare_masses(robot_file)), encoding="utf-8"
    )


def count_impossible(document: dict[str, Any]) -> int:
    """Count the springs and masses of a verdict that are stated below zero."""
    stated = [
        value
        for value, identifiable in zip(
            document["compliance_urad_per_Nm"]["after"],
            document["compliance_urad_per_Nm"]["identifiable"],
            strict=True,
        )
        if identifiable or value
    ]
    for effect in document["effects"]:
        stated += [
            parameter["value"]
            for parameter in effect["parameters"]
            if parameter["unit"] == "kg" and "mass" in parameter["name"]
        ]
    return sum(value < 0 for value in stated)


def diagnose_one(name: str, seed: int) -> dict[str, Any]:
    """Diagnose one campaign."""
    with TemporaryDirectory() as top:
        folder = Path(top, f"{name}_{seed}")
        measure(folder, name, seed)
        training, held_out = read_cases(folder, ROBOTS)
    diagnosis = diagnose(training, Settings(), 1)
    document = judge(diagnosis, held_out, 1).document
    heldout = document["heldout"]
    probabilities = document["probabilities"] or {"mechanisms": {}}
    return {
        "robot": name,
        "seed": seed,
        "verdict": document["verdict"],
        "impossible": count_impossible(document),
        "names": {
            effect: round(probability, 3)
            for effect, probability in probabilities["mechanisms"].items()
            if probability >= FALSE_NAME and effect != "other"
        },
        "adopted": any(effect.get("adopted") for effect in document["effects"]),
        "after_m": heldout["after"]["rms_m"],
        "declared_m": heldout.get("declared", heldout["before"])["rms_m"],
        "floor_m": heldout["noise_floor_rms_m"],
    }


def main() -> None:
    options = make_parser(__doc__, ARMS).parse_args()
    print("robot cases impossible false_names adopted after_over_floor")
    for name in options.robots:
        rows = []
        for seed in range(options.first_seed, options.first_seed + options.cases):
            rows.append(diagnose_one(name, seed))
            if options.each:
                print(json.dumps(rows[-1]), flush=True)
        ratios = [row["after_m"] / (row["floor_m"] or np.nan) for row in rows]
        print(
            name,
            len(rows),
            sum(row["impossible"] > 0 for row in rows),
            sum(bool(row["names"]) for row in rows),
            sum(row["adopted"] for row in rows),
            f"{np.nanmedian(ratios):.2f}",
            flush=True,
        )


if __name__ == "__main__":
    main()
