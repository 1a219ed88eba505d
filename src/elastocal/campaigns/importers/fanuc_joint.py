"""Both sessions of the FANUC as one campaign: one robot, two tools, two tracker frames."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from elastocal.campaigns.importers import fanuc_cpa, fanuc_static
from elastocal.campaigns.importers.reflectors import pose_and_repeat, reflector_table, unloaded_document
from elastocal.campaigns.reading import read_robot
from elastocal.campaigns.writing import write_campaign as write_folder

# Its file has no reported_joints: the sessions count their angles differently, so the campaign holds the chain's own.
ROBOT = "fanuc_measured"
FILES = fanuc_static.FILES | fanuc_cpa.FILES
ROBOTS = (ROBOT, *fanuc_static.ROBOTS, *fanuc_cpa.ROBOTS)


def write_campaign(
    static_path: str | Path,
    cpa_path: str | Path,
    folder: str | Path,
    robots_folder: str | Path,
    name: str = "fanuc_joint",
    holdout: Mapping[str, Any] | None = None,
) -> None:
    """Write both sources as the sessions 0 (static) and 1 (cpa) of one campaign.

    `static_path`, `cpa_path`: as for `fanuc_static` and `fanuc_cpa`. `robots_folder`: holds the robot files of both sources,
    which say how each counts its angles. `holdout`: as in ``campaign.yaml``. Raises `InputError`: as in the ``read`` of both,
    and a robot file that is not there.
    """
    tables = []
    for session, (source, path) in enumerate(((fanuc_static, static_path), (fanuc_cpa, cpa_path))):
        reported, positions = source.read(path)
        robot = read_robot(Path(robots_folder) / f"{source.ROBOT}.yaml")
        tables.append(reflector_table(*pose_and_repeat(reported), robot.model_angles(reported), positions, session))
    table = {column: np.concatenate([part[column] for part in tables]) for column in tables[0]}
    targets = (*fanuc_static.TARGETS, *fanuc_cpa.TARGETS)
    write_folder(folder, unloaded_document(name, ROBOT, "position", targets, holdout), table, robot.joints)
