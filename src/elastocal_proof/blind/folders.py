"""The analyst's folder, and the sealed ground truth outside of it. A campaign's format
is a contract of both sides."""

from __future__ import annotations

import hashlib
import json
import platform
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import yaml

from elastocal.campaigns.writing import write_campaign
from elastocal.errors import InputError
from elastocal.io.atomic_writes import write_text
from elastocal.io.json_files import read_json
from elastocal_proof.plant.arm import Arm, LinkMass
from elastocal_proof.plant.campaigns import (
    Blunder,
    Design,
    Table,
    simulate_measurements,
)
from elastocal_proof.plant.simulated_robot import Schedule, SimulatedRobot

DamageRows = Callable[[Table], tuple[Table, list[Blunder]]]

ROBOT_FILE = "robot.yaml"


def build_campaign_document(name: str, arm: Arm, design: Design) -> dict[str, Any]:
    """Contents of campaign.yaml; nothing in it depends on the defects."""
    document = {
        "campaign": name,
        "robot": ROBOT_FILE,
        "measured": design.measured,
        "frame": design.frame,
        "targets": {
            f"{point}": {"point": point, "offset_m": [0, 0, 0]}
            for point in design.points or arm.points
        },
        "compliance": "identify",
        "declared": list(design.declared),
        "holdout": {"poses": list(range(design.poses - design.held_out, design.poses))},
        "remainder": "none",
    }
    if design.declared_noise is not None:
        document["noise"] = dict(
            zip(("position_m", "orientation_rad"), design.declared_noise, strict=True)
        )
    return document


def write_blind_campaign(
    folder: str | Path,
    name: str,
    robot_file: str | Path,
    robot: SimulatedRobot,
    design: Design,
    schedule: Schedule,
    declared: Sequence[LinkMass] = (),
    slipped: DamageRows | None = None,
) -> dict[str, Any]:
    """Measure, and write what the analyst gets; returns how the data were made, for the
    ground truth of the case.

    `folder`: the campaign's own. `name`: of the campaign; must not give the ground
    truth away. `robot_file`: of which the robot is a specimen. `declared`: weights as
    they are declared to the analyst. `slipped`: what goes wrong in the file.
    """
    table = simulate_measurements(robot, design, schedule)
    table, slips = slipped(table) if slipped else (table, [])
    write_campaign(
        folder,
        build_campaign_document(name, robot.arm, design),
        table,
        robot.arm.joints,
        "parquet",
    )
    write_robot_file(folder, robot_file, robot, declared, design.undeclared)
    return {
        "campaign": name,
        "robot": Path(robot_file).stem,
        "seed": schedule.seed,
        "design": asdict(design),
        "compliance_urad_per_Nm": (1e6 * robot.compliance).tolist(),
        "masses": [asdict(mass) for mass in robot.structure.masses],
        "declared_masses": [asdict(mass) for mass in declared],
        "noise": {
            name: getattr(robot.tracker, name)
            for name in ("sigma_m", "sigma_m_per_m", "sigma_rad")
        },
        "measurements": len(table["pose"]),
        "made_with": {
            "mujoco": mujoco.__version__,
            "numpy": np.__version__,
            "python": platform.python_version(),
        },
    } | ({"bad_rows": slips} if slipped else {})


def write_robot_file(
    folder: str | Path,
    robot_file: str | Path,
    robot: SimulatedRobot,
    declared: Sequence[LinkMass],
    undeclared: Sequence[str] = (),
) -> None:
    """Write the campaign's own robot file: without masses where none are declared, and
    without the keys that are undeclared."""
    arm = robot.arm
    nominal = yaml.safe_load(Path(robot_file).read_text(encoding="utf-8"))
    absent = ("masses", "gravity_m_s2", "compensator", "payload_kg", *undeclared)
    document = {key: value for key, value in nominal.items() if key not in absent}
    if declared:
        document["masses"] = [
            {
                "link": m.link,
                "mass_kg": m.mass_kg,
                "centre_m": [*m.centre_m],
                "relative_std": m.relative_std,
            }
            for m in declared
        ]
    document |= {
        "gravity_m_s2": list(robot.structure.gravity_m_s2),
        "payload_kg": round(arm.payload_kg, 1),
    }
    document["gear_ratio"] = list(arm.gear_ratio)
    if arm.compensated:
        document["compensator"] = nominal.get(
            "compensator", {"joint": 2, "kind": "spring"}
        )
    write_text(
        Path(folder) / ROBOT_FILE,
        yaml.safe_dump(document, sort_keys=False, default_flow_style=None, width=120),
    )


def write_truth(
    path: str | Path, truth: Mapping[str, Any], campaign_folder: str | Path
) -> str:
    """Seal the ground truth of a case as sorted JSON; returns its SHA-256, to be
    published before any diagnosis.

    Raises `ValueError`: the file would lie in the campaign's folder.
    """
    path = Path(path)
    folder = Path(campaign_folder)
    if folder.resolve() in path.resolve().parents:
        raise ValueError(
            f"{path}: the ground truth must not lie in the campaign's folder {folder}"
        )
    text = json.dumps(truth, indent=1, sort_keys=True, allow_nan=False) + "\n"
    path.parent.mkdir(parents=True, exist_ok=True)
    write_text(path, text)
    return hashlib.sha256(text.encode()).hexdigest()


def seal_cases(job: Any) -> None:
    """The commitment that is published before any diagnosis: a line ``sha256  name`` for each ground truth."""
    files = sorted(_sealed_in(job.input.sealed), key=lambda file: file.name)
    lines = [
        f"{hashlib.sha256(file.read_bytes()).hexdigest()}  {file.name}\n"
        for file in files
    ]
    write_text(job.output.manifest, "".join(lines))


def load_ground_truth(
    folders: Iterable[str | Path], manifest: str | Path
) -> dict[str, dict[str, Any]]:
    """Sealed documents by the name of the case, in its order, for the scores and the
    oracle only.

    Raises `InputError`: a file is not the one whose hash was published.
    """
    lines = Path(manifest).read_text(encoding="utf-8").splitlines()
    published = {name: digest for digest, name in map(str.split, lines)}
    truths = {}
    for file in sorted(_sealed_in(folders), key=lambda file: file.name):
        found = hashlib.sha256(file.read_bytes()).hexdigest()
        if published.get(file.name) != found:
            raise InputError(
                file, "", f"SHA-256 {found}", f"{published.get(file.name)}, as sealed"
            )
        truths[file.stem] = read_json(file)
    return truths


def _sealed_in(folders: Iterable[str | Path]) -> list[Path]:
    return [file for folder in folders for file in Path(folder).glob("*.json")]
