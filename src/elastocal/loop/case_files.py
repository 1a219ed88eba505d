"""The case of a campaign from the files that step 1 wrote."""

from __future__ import annotations

from typing import TYPE_CHECKING

from elastocal.fitting.case import Case, case_from
from elastocal.io.json_files import read_json
from elastocal.io.storage import read_table
from elastocal.loop.schemas import measurements
from elastocal.mechanics.robot_file import joint_count

if TYPE_CHECKING:
    from pathlib import Path


def load_case(descriptions_path: str | Path, measurements_path: str | Path, part: str | None = None) -> Case:
    """A campaign from the files of step 1.

    `part`: the campaign that holds the test, where it is another one.
    """
    descriptions = read_json(descriptions_path)
    described = (part and descriptions[part]) or descriptions
    joints = joint_count(described["robot"], described["source"])
    return case_from(described, read_table(measurements_path, measurements(joints)))
