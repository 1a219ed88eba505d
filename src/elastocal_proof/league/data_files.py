"""A data set of the league from its files."""

from __future__ import annotations

from typing import TYPE_CHECKING

from elastocal.io.json_files import read_json
from elastocal.io.storage import read_table
from elastocal.loop.schemas import measurements
from elastocal.mechanics.robot_file import joint_count
from elastocal_proof.league.rounds import DataSet
from elastocal_proof.league.schemas import FOLDS

if TYPE_CHECKING:
    from pathlib import Path


def load_data_set(descriptions_path: str | Path, measurements_path: str | Path, folds_path: str | Path) -> DataSet:
    """Read a data set.

    `descriptions_path`, `measurements_path`, `folds_path`: as `deal_league_folds` wrote them.
    """
    descriptions = read_json(descriptions_path)
    joints = joint_count(descriptions["robot"], descriptions["source"])
    return DataSet(descriptions, read_table(measurements_path, measurements(joints)), read_table(folds_path, FOLDS))
