"""The analyst's folder of a blind case, and its sealed ground truth, which lies outside
of that folder.

The format of a campaign is a contract of both sides.
"""

from __future__ import annotations

import hashlib
import json
import platform
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
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

# Damages some rows of a table of measurements, and says which.
DamageRows = Callable[[Table], tuple[Table, list[Blunder]]]

ROBOT_FILE = "robot.yaml"


@dataclass(frozen=True)
class Experiment:
    """A simulated robot, the design of its campaign and the schedule of that design."""

    robot: SimulatedRobot
    design: Design
    schedule: Schedule


def build_campaign_document(name: str, arm: Arm, design: Design) -> dict[str, Any]:
    """Build the contents of campaign.yaml, which do not depend on the defects."""
    uncertainty = {}
    if design.offset_std_m is not None:
        uncertainty["offset_std_m"] = design.offset_std_m
    targets = {
        f"{point}": {"point": point, "offset_m": [0, 0, 0], **uncertainty}
        for point in design.points or arm.points
    }
    document = {
        "campaign": name,
        "robot": ROBOT_FILE,
        "measured": design.measured,
        "frame": design.frame,
        "targets": targets,
        "compliance": "identify",
        "application_point_std_m": 0,
        "declared": list(design.declared),
        "holdout": {"poses": list(range(design.poses - design.held_out, design.poses))},
        "remainder": "none",
    }
    if design.declared_noise is not None:
        position_m, orientation_rad = design.declared_noise
        document["noise"] = {
            "position_m": position_m,
            "orientation_rad": orientation_rad,
        }
    return document


def write_blind_campaign(
    folder: str | Path,
    name: str,
    robot_file: str | Path,
    experiment: Experiment,
    declared: Sequence[LinkMass] = (),
    damage_rows: DamageRows | None = None,
) -> dict[str, Any]:
    """Simulate the measurements and write the analyst's folder.

    Parameters
    ----------
    folder : path
        Folder of the campaign.
    name : str
        Name of the campaign, which must not reveal the ground truth.
    robot_file : path
        Robot file of which the robot is a specimen.
    experiment : Experiment
        What is simulated.
    declared : sequence of LinkMass
        Weights as they are declared to the analyst.
    damage_rows : callable, optional
        Damages some rows of the table before it is written.

    Returns
    -------
    dict
        How the data were made, for the ground truth of the case.
    """
    robot = experiment.robot
    design = experiment.design
    table = simulate_measurements(robot, design, experiment.schedule)
    slips = None
    if damage_rows is not None:
        table, slips = damage_rows(table)
    document = build_campaign_document(name, robot.arm, design)
    write_campaign(folder, document, table, robot.arm.joints, "parquet")
    write_robot_file(folder, robot_file, robot, declared, design.undeclared)
    record = {
        "campaign": name,
        "robot": Path(robot_file).stem,
        "seed": experiment.schedule.seed,
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
    }
    if slips is not None:
        record["bad_rows"] = slips
    return record


def write_robot_file(
    folder: str | Path,
    robot_file: str | Path,
    robot: SimulatedRobot,
    declared: Sequence[LinkMass],
    undeclared: Sequence[str] = (),
) -> None:
    """Write the robot file of a campaign.

    Parameters
    ----------
    folder : path
        Folder of the campaign.
    robot_file : path
        Robot file of which the robot is a specimen.
    robot : SimulatedRobot
        The robot.
    declared : sequence of LinkMass
        Weights as they are declared to the analyst; without any, the file has no
        ``masses``.
    undeclared : sequence of str
        Keys that the file lacks.
    """
    arm = robot.arm
    nominal = yaml.safe_load(Path(robot_file).read_text(encoding="utf-8"))
    absent = ("masses", "gravity_m_s2", "compensator", "payload_kg", *undeclared)
    document = {key: value for key, value in nominal.items() if key not in absent}
    if declared:
        document["masses"] = [
            {
                "link": mass.link,
                "mass_kg": mass.mass_kg,
                "centre_m": [*mass.centre_m],
                "relative_std": mass.relative_std,
            }
            for mass in declared
        ]
    document["gravity_m_s2"] = list(robot.structure.gravity_m_s2)
    document["payload_kg"] = round(arm.payload_kg, 1)
    document["gear_ratio"] = list(arm.gear_ratio)
    if arm.compensated:
        usual_compensator = {"joint": 2, "kind": "spring"}
        document["compensator"] = nominal.get("compensator", usual_compensator)
    write_text(
        Path(folder) / ROBOT_FILE,
        yaml.safe_dump(document, sort_keys=False, default_flow_style=None, width=120),
    )


def write_truth(
    path: str | Path, truth: Mapping[str, Any], campaign_folder: str | Path
) -> str:
    """Write the ground truth of a case as sorted JSON.

    Returns
    -------
    str
        Its SHA-256, which is published before any diagnosis.

    Raises
    ------
    ValueError
        If the file would lie in the campaign's folder.
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
    """Write the commitment that is published before any diagnosis: a line ``sha256
    name`` for each ground truth."""
    lines = [
        f"{_hash_file(file)}  {file.name}\n"
        for file in _list_sealed_files(job.input.sealed)
    ]
    write_text(job.output.manifest, "".join(lines))


def load_ground_truth(
    folders: Iterable[str | Path], manifest: str | Path
) -> dict[str, dict[str, Any]]:
    """Load the sealed documents, for the scores and the oracle only.

    Parameters
    ----------
    folders : iterable of path
        Folders of sealed documents.
    manifest : path
        Published hashes, as `seal_cases` writes them.

    Returns
    -------
    dict
        Documents by the name of the case, in the order of these names.

    Raises
    ------
    InputError
        If the hash of a file is not the published one.
    """
    published = {}
    for line in Path(manifest).read_text(encoding="utf-8").splitlines():
        digest, name = line.split()
        published[name] = digest
    truths = {}
    for file in _list_sealed_files(folders):
        digest = _hash_file(file)
        if published.get(file.name) != digest:
            raise InputError(
                file, "", f"SHA-256 {digest}", f"{published.get(file.name)}, as sealed"
            )
        truths[file.stem] = read_json(file)
    return truths


def _list_sealed_files(folders: Iterable[str | Path]) -> list[Path]:
    """List the sealed documents of some folders by name."""
    files = [file for folder in folders for file in Path(folder).glob("*.json")]
    return sorted(files, key=lambda file: file.name)


def _hash_file(file: Path) -> str:
    return hashlib.sha256(file.read_bytes()).hexdigest()
