"""The documents of a campaign's folder are read only once."""

import hashlib
import shutil
from pathlib import Path

import pytest
import yaml

from elastocal.campaigns import campaign_folder
from elastocal.campaigns.reading import read_campaign, read_held_out_campaign
from elastocal.errors import InputError


@pytest.fixture
def read_files(monkeypatch):
    """Paths of the documents that have been read, in their order."""
    files = []
    read_document = campaign_folder.read_document

    def read_and_note(path):
        files.append(Path(path).as_posix())
        return read_document(path)

    monkeypatch.setattr(campaign_folder, "read_document", read_and_note)
    return files


@pytest.fixture
def validated_cell(cell, tmp_path):
    """A campaign that is validated by a copy of itself."""
    cell.write()
    shutil.copytree(cell.folder, tmp_path / "other")
    cell.document["holdout"] = {"campaign": "../other"}
    cell.write()
    return cell


def test_every_document_is_read_once(validated_cell, read_files):
    folder = validated_cell.open()
    for _ in range(2):
        read_campaign(folder)
        read_held_out_campaign(folder)
        assert len(folder.files()) == len(folder.digests)
    validation_folder = f"{validated_cell.folder}/../other"
    assert sorted(read_files) == sorted(
        f"{path}/{name}"
        for path in (validated_cell.folder, validation_folder)
        for name in ("campaign.yaml", "arm.yaml")
    )


def test_the_files_of_a_campaign_are_listed_without_reading_its_robot(
    validated_cell, read_files
):
    folder = validated_cell.open()
    names = [Path(file).name for file in folder.files()]
    assert names == ["campaign.yaml", "measurements.csv", "arm.yaml"] * 2
    assert {Path(file).name for file in read_files} == {"campaign.yaml"}


def test_digests_are_those_of_the_files_by_their_roles(validated_cell):
    """A role says of which campaign a file is: here all names are there twice."""
    other = validated_cell.folder.parent / "other" / "measurements.csv"
    other.write_text(other.read_text() + "\n")
    roles = (
        "campaign/campaign.yaml",
        "campaign/measurements.csv",
        "robot/arm.yaml",
        "held_out/campaign/campaign.yaml",
        "held_out/campaign/measurements.csv",
        "held_out/robot/arm.yaml",
    )
    folder = validated_cell.open()
    expected = {
        role: hashlib.sha256(Path(file).read_bytes()).hexdigest()
        for role, file in zip(roles, folder.files(), strict=True)
    }
    assert folder.digests == expected
    measurements = validated_cell.folder / "measurements.csv"
    contents = measurements.read_bytes()
    measurements.write_bytes(other.read_bytes())
    other.write_bytes(contents)
    exchanged = validated_cell.open().digests
    assert exchanged != expected
    assert sorted(exchanged.values()) == sorted(expected.values())


def test_a_campaign_that_holds_out_its_own_poses_has_no_other_folder(cell):
    cell.write()
    folder = cell.open()
    assert folder.held_out_path is None
    assert folder.held_out_folder is None
    assert read_held_out_campaign(folder) is None


def test_a_campaign_knows_its_documents(cell):
    cell.write()
    folder = cell.open()
    assert folder.name == cell.document["campaign"]
    assert folder.source == cell.source
    robot_text = (cell.folder / "arm.yaml").read_text(encoding="utf-8")
    assert folder.robot_document == yaml.safe_load(robot_text)


def test_the_document_of_the_campaign_is_no_robot_of_its_folder(cell):
    cell.document["robot"] = "campaign"
    cell.write()
    with pytest.raises(InputError, match="or a robot of") as caught:
        campaign_folder.read_campaign_folder(cell.folder, cell.folder)
    assert (
        "campaign" not in str(caught.value).partition("or a robot of")[2].split(":")[1]
    )
