"""The folder that an analyst gets, and the sealed truth that he does not. The only module that knows elastocal's format."""

import hashlib
import json
import platform
from dataclasses import asdict
from pathlib import Path

import mujoco
import numpy as np

from elastocal.campaign import write_campaign
from elastocal.plant.campaigns import measured_table
from elastocal.whole_files import appearing_whole


def campaign_document(name, robot_name, arm, design):
    """Contents of campaign.yaml; nothing in it depends on the defects."""
    document = {
        "campaign": name,
        "robot": robot_name,
        "measured": design.measured,
        "frame": design.frame,
        "targets": {f"{point}": {"point": point, "offset_m": [0, 0, 0]} for point in design.points or arm.points},
        "compliance": "identify",
        "declared": list(design.declared),
        "holdout": {"poses": list(range(design.poses - design.held_out, design.poses))},
    }
    if design.declared_noise is not None:
        document["noise"] = dict(zip(("position_m", "orientation_rad"), design.declared_noise, strict=True))
    return document


def write_blind_campaign(folder, name, robot_name, robot, design, schedule, kind="parquet"):
    """Measure, and write what the analyst gets.

    Parameters
    ----------
    folder : str or Path
        The campaign's own.
    name : str
        Of the campaign; must not give the truth away.
    robot_name : str
        Robot file in config/robots.
    robot : PhysicalRobot
    design : Design
    schedule : Schedule
    kind : {"parquet", "csv"}

    Returns
    -------
    dict
        What a truth document says of the making of the data.
    """
    table, outliers = measured_table(robot, design, schedule)
    write_campaign(folder, campaign_document(name, robot_name, robot.arm, design), table, robot.arm.joints, kind)
    return {
        "campaign": name,
        "robot": robot_name,
        "seed": schedule.seed,
        "design": asdict(design),
        "compliance_urad_per_Nm": (1e6 * robot.compliance).tolist(),
        "noise": {name: getattr(robot.tracker, name) for name in ("sigma_m", "sigma_m_per_m", "sigma_rad")},
        "outliers": [list(outlier) for outlier in outliers],
        "readings": len(table["pose"]),
        "made_with": {"mujoco": mujoco.__version__, "numpy": np.__version__, "python": platform.python_version()},
    }


def write_truth(path, truth, campaign_folder):
    """Seal a truth document: sorted JSON, outside of the campaign's folder.

    Parameters
    ----------
    path : str or Path
    truth : dict
    campaign_folder : str or Path

    Returns
    -------
    str
        SHA-256 of the file, to be published before any diagnosis.

    Raises
    ------
    ValueError
        The file would lie in the campaign's folder.
    """
    path, folder = Path(path), Path(campaign_folder)
    if folder.resolve() in path.resolve().parents:
        raise ValueError(f"{path}: the truth must not lie in the campaign's folder {folder}")
    text = json.dumps(truth, indent=1, sort_keys=True, allow_nan=False) + "\n"
    path.parent.mkdir(parents=True, exist_ok=True)
    with appearing_whole(path) as partial, open(partial, "w", encoding="utf-8") as file:
        file.write(text)
    return hashlib.sha256(text.encode()).hexdigest()
