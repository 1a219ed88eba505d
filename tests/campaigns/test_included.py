"""Campaigns that come with the project are complete, state their origin, and are copied
only if their contents are those of the digest."""

from pathlib import Path

import numpy as np
import pytest
import yaml
from support import refused

from elastocal.campaigns.campaign_folder import read_campaign_folder
from elastocal.campaigns.included import copy_included_campaign
from elastocal.campaigns.reading import read_campaign
from elastocal.io.documents import read_document
from elastocal.io.records import compute_sha256

ROOT = Path(__file__).resolve().parents[2]
BOX = ROOT / "data" / "measured"
CAMPAIGNS = ROOT / "config" / "campaigns"
DOCUMENTS = {path.stem: read_document(path) for path in CAMPAIGNS.glob("*.yaml")}
INCLUDED = {
    name: document
    for name, document in DOCUMENTS.items()
    if document["source"] == "included"
}


@pytest.mark.parametrize("name", INCLUDED)
def test_an_included_campaign_is_copied_with_its_numbers_and_its_own_held_out_poses(
    name, tmp_path
):
    settings = INCLUDED[name]
    source = BOX / settings["folder"]
    copy_included_campaign(
        source, tmp_path / name, name, settings["sha256"], settings.get("holdout")
    )
    robots = ROOT / "config" / "robots"
    copy = read_campaign(read_campaign_folder(tmp_path / name, robots))
    original = read_campaign(read_campaign_folder(source, robots))
    np.testing.assert_array_equal(
        copy.measurements.joint_angles, original.measurements.joint_angles
    )
    np.testing.assert_array_equal(
        copy.measurements.position, original.measurements.position
    )
    document = yaml.safe_load((tmp_path / name / "campaign.yaml").read_text())
    assert document["campaign"] == name
    default = read_document(source / "campaign.yaml")["holdout"]
    assert document["holdout"] == settings.get("holdout", default)


@pytest.mark.parametrize("folder", sorted({s["folder"] for s in INCLUDED.values()}))
def test_the_origin_of_included_data_is_stated(folder):
    page = (BOX / "README.md").read_text(encoding="utf-8")
    licence = (BOX / folder / "LICENSE").read_text(encoding="utf-8")
    assert "MIT License" in licence
    assert folder in page
    assert compute_sha256(BOX / folder / "measurements.csv") in page


def test_other_contents_than_the_digest_says_are_refused(tmp_path):
    source = BOX / "fr3_board"
    with refused(source / "measurements.csv", "", "SHA-256", "0" * 64):
        copy_included_campaign(source, tmp_path / "mine", "mine", "0" * 64)
