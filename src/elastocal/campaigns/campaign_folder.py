"""A campaign's folder on disk: its documents, read once, and the files it consists of.

A campaign is a folder with ``campaign.yaml`` and either ``measurements.csv`` or
``measurements.parquet``. Its robot is described by a file in the folder or by one of
the project's robot files. `reading.read_campaign` adds the measurements.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from elastocal.campaigns.campaign import DEFAULT_HOLDOUT, DOCUMENT
from elastocal.campaigns.measurements import CSV, PARQUET, find_files, is_file_in
from elastocal.errors import InputError, find_control_character, suggest_names
from elastocal.io.documents import check_document, read_document, read_schema
from elastocal.io.records import compute_sha256
from elastocal.mechanics.robot import Robot
from elastocal.mechanics.robot_file import parse_robot

# What Snakemake takes for something else in a path: wildcards, names of folders, quotes
# that it removes, and a mapping and a comment of YAML.
_REFUSED_IN_PATHS = ("{", "}", "<", ">", "'", '"', ": ", " #")


@dataclass(frozen=True)
class CampaignFolder:
    """A campaign on disk, made by `read_campaign_folder`.

    Pass this object on instead of the paths, so that a document is not read twice. The
    other files are read on first use.

    Attributes
    ----------
    path : folder of the campaign.
    robots_folder : folder with the robot files that a campaign may name.
    document : contents of ``campaign.yaml``, checked against its schema.
    robot_file : file that describes the robot.
    """

    path: Path
    robots_folder: Path
    document: dict[str, Any]
    robot_file: Path

    @property
    def name(self) -> str:
        """Name of the campaign."""
        name: str = self.document["campaign"]
        return name

    @property
    def source(self) -> str:
        """Path of ``campaign.yaml``, for messages."""
        return (self.path / DOCUMENT).as_posix()

    @property
    def holdout(self) -> dict[str, Any]:
        """Rule that selects the held-out poses, as in ``campaign.yaml``."""
        holdout: dict[str, Any] = self.document.get("holdout", DEFAULT_HOLDOUT)
        return holdout

    @cached_property
    def robot_document(self) -> dict[str, Any]:
        """Contents of the robot file, checked against its schema."""
        return read_robot_document(self.robot_file)

    @cached_property
    def robot(self) -> Robot:
        """Nominal robot, as its file describes it."""
        return parse_robot(self.robot_document, self.robot_file.as_posix())

    @cached_property
    def held_out_path(self) -> Path | None:
        """Folder of the campaign that validates this one; None if this campaign holds
        out poses of its own.

        An `InputError` refuses a folder that has no campaign, that is neither beside
        nor below this one, or that is this one.
        """
        if "campaign" not in self.holdout:
            return None
        stated = self.holdout["campaign"]
        folder = self.path / stated
        key = "holdout.campaign"
        allowed = f"a folder beside this one with a {DOCUMENT}, such as ../other"
        if not is_file_in(folder / DOCUMENT, self.path.resolve().parent):
            raise InputError(self.source, key, repr(stated), allowed)
        if folder.samefile(self.path):
            finding = f"{stated!r}, the campaign itself"
            raise InputError(self.source, key, finding, allowed)
        return folder

    @cached_property
    def held_out_folder(self) -> CampaignFolder | None:
        """Campaign that validates this one, or None."""
        if self.held_out_path is None:
            return None
        return read_campaign_folder(self.held_out_path, self.robots_folder)

    def files(self) -> list[str]:
        """Return the files from which the campaign is read, including those of the
        campaign that validates it."""
        files = self._own_files()
        # Two campaigns may validate each other, so the campaign that validates the
        # other one is left out.
        if self.held_out_folder is not None:
            files += self.held_out_folder._own_files()
        return [file.as_posix() for file in files]

    def _own_files(self) -> list[Path]:
        measurements = find_files(self.path, CSV, PARQUET)
        return [self.path / DOCUMENT, *measurements, self.robot_file]

    @cached_property
    def digests(self) -> dict[str, str]:
        """SHA-256 of each file from which the campaign is read, by its role.

        A role is ``campaign/`` or ``robot/`` and the name of the file; those of the
        campaign that validates this one begin with ``held_out/``. The folders
        themselves may move.
        """
        digests = self._digest_own_files()
        if self.held_out_folder is not None:
            for role, digest in self.held_out_folder._digest_own_files().items():
                digests[f"held_out/{role}"] = digest
        return digests

    def _digest_own_files(self) -> dict[str, str]:
        """SHA-256 of the files without those of the campaign that validates this one,
        by their roles."""
        digests = {}
        for file in self._own_files():
            kind = "robot" if file == self.robot_file else "campaign"
            digests[f"{kind}/{file.name}"] = compute_sha256(file)
        return digests


def check_workflow_path(path: str) -> None:
    """Refuse a path that Snakemake would take for another one or for something else: an
    InputError."""
    marks = [mark for mark in _REFUSED_IN_PATHS if mark in path]
    mark = marks[0] if marks else find_control_character(path)
    if path != path.strip():
        mark = " "
    if mark:
        raise InputError(
            path,
            "",
            repr(mark),
            "a path without it, which Snakemake does not take for a path; a blank may"
            " stand inside",
        )


def check_campaign_name(folder: Path) -> None:
    """Refuse a folder after which no campaign can be named, before anything is written
    into it."""
    check_workflow_path(folder.as_posix())
    name = folder.absolute().name
    rule = read_schema("campaign")["properties"]["campaign"]
    if not re.search(rule["pattern"], name) or len(name) > rule["maxLength"]:
        raise InputError(folder, "name", repr(name), rule["description"])


def read_campaign_folder(path: str | Path, robots_folder: str | Path) -> CampaignFolder:
    """Read ``campaign.yaml`` of a folder and find the file of its robot.

    Parameters
    ----------
    path : folder of the campaign.
    robots_folder : folder with the robot files that a campaign may name.

    Raises
    ------
    InputError
        If the document is missing or its schema refuses it, or if its robot is neither
        a file in the folder nor one of the named robots.
    """
    path = Path(path)
    robots_folder = Path(robots_folder)
    source = (path / DOCUMENT).as_posix()
    find_files(path, DOCUMENT)
    document = read_document(source)
    check_document(document, "campaign", source)
    robot = document["robot"]
    files = robots_folder.glob("*.yaml")
    named_robots = sorted(file.stem for file in files if file.name != DOCUMENT)
    is_named = robot in named_robots
    robot_file = robots_folder / f"{robot}.yaml" if is_named else path / robot
    if not is_file_in(robot_file, path, robots_folder):
        listed = f"{robots_folder.as_posix()}: {suggest_names(robot, named_robots)}"
        allowed = (
            "a file in this folder, named relative to this folder, "
            f"or a robot of {listed}"
        )
        raise InputError(source, "robot", repr(robot), allowed)
    return CampaignFolder(path, robots_folder, document, robot_file)


def read_robot_document(path: str | Path) -> dict[str, Any]:
    """Read a robot file and check it against its schema."""
    source = Path(path).as_posix()
    document: dict[str, Any] = read_document(source)
    check_document(document, "robot", source)
    return document
