"""What the folder of a blind campaign holds, what it must not hold, and the sealed record beside it."""

import hashlib
import json
from types import SimpleNamespace

import numpy as np
import pytest
from analysed_robots import ROBOTS

from elastocal.campaigns.holdout import split
from elastocal.campaigns.reading import read_campaign
from elastocal.errors import InputError
from elastocal_proof.blind.folders import (
    load_ground_truth,
    seal_cases,
    write_blind_campaign,
    write_truth,
)
from elastocal_proof.plant.arm import arm_from_file
from elastocal_proof.plant.campaigns import Design, schedule_of
from elastocal_proof.plant.kinds import Defect, truth_of
from elastocal_proof.plant.physical_robot import specimen


@pytest.fixture(scope="module")
def fanuc_specimen():
    return specimen(arm_from_file(ROBOTS / "fanuc.yaml"), 4)


@pytest.fixture(scope="module")
def small():
    """A short campaign."""
    return Design(poses=8, held_out=2, repeated_poses=3, repeats=2)


def made(folder, robot, design, seed=2, **more):
    return write_blind_campaign(
        folder, "case0", ROBOTS / "fanuc.yaml", robot, design, schedule_of(robot.arm, design, seed), **more
    )


@pytest.mark.parametrize("kind", ["parquet", "csv"])
def test_the_analysis_reads_the_folder_and_holds_out_the_designed_poses(tmp_path, fanuc_specimen, small, kind):
    made(tmp_path / "case0", fanuc_specimen, small, kind=kind)
    campaign = read_campaign(tmp_path / "case0", ROBOTS)
    training, held_out = split(campaign)
    schedule = schedule_of(fanuc_specimen.arm, small, 2)
    assert set(training.pose) == set(schedule.pose[schedule.training])
    assert set(held_out.pose) == set(schedule.pose[~schedule.training])
    assert len(campaign.measurements.pose) == 4 * len(schedule.pose)


@pytest.mark.parametrize("name", ["kuka", "fanuc", "abb", "fanuc_cpa"])
def test_angles_stand_in_the_folder_as_the_controller_shows_them(tmp_path, small, name):
    robot = specimen(arm_from_file(ROBOTS / f"{name}.yaml"), 1)
    write_blind_campaign(tmp_path / "c", "c", ROBOTS / f"{name}.yaml", robot, small, schedule_of(robot.arm, small, 2))
    measurements = read_campaign(tmp_path / "c", ROBOTS).measurements
    np.testing.assert_allclose(measurements.joint_angles[::4], schedule_of(robot.arm, small, 2).angle, atol=1e-12)


def test_the_record_is_sealed_outside_of_the_folder_by_its_hash(tmp_path, fanuc_specimen):
    record = {"defects": [truth_of(fanuc_specimen, Defect("lost_motion", (2,), 1e-4, 1))]}
    sealed = tmp_path / "sealed" / "case0.json"
    digest = write_truth(sealed, record, tmp_path / "blind" / "case0")
    assert digest == hashlib.sha256(sealed.read_bytes()).hexdigest()
    assert json.loads(sealed.read_text()) == record


def test_a_record_is_refused_anywhere_inside_the_campaigns_folder_however_the_path_is_written(tmp_path):
    folder = tmp_path / "blind" / "case0"
    for path in (folder / "deep" / "case0.json", folder / ".." / "case0" / "case0.json"):
        with pytest.raises(ValueError, match="must not lie"):
            write_truth(path, {}, folder)
    # A name that only begins alike is another folder.
    assert write_truth(tmp_path / "blind" / "case00" / "case0.json", {}, folder)


@pytest.fixture
def sealed(tmp_path):
    """Two ground truths in two folders, and the manifest that a job published."""
    folders = [tmp_path / "one", tmp_path / "two"]
    for folder, name in zip(folders, ("case_b", "case_a"), strict=True):
        folder.mkdir()
        (folder / f"{name}.json").write_text(f'{{"campaign": "{name}"}}', encoding="utf-8")
    manifest = tmp_path / "manifest.sha256"
    seal_cases(SimpleNamespace(input=SimpleNamespace(sealed=folders), output=SimpleNamespace(manifest=manifest)))
    return folders, manifest


def test_a_manifest_names_the_hash_of_every_truth_in_the_order_of_their_names(sealed):
    folders, manifest = sealed
    lines = [line.split() for line in manifest.read_text(encoding="utf-8").splitlines()]
    assert [name for _, name in lines] == ["case_a.json", "case_b.json"]
    assert lines[1][0] == hashlib.sha256((folders[0] / "case_b.json").read_bytes()).hexdigest()


def test_ground_truths_come_by_the_names_of_their_cases(sealed):
    found = load_ground_truth(*sealed)
    assert found == {name: {"campaign": name} for name in ("case_a", "case_b")} and list(found) == ["case_a", "case_b"]


def test_a_ground_truth_that_was_changed_or_not_published_is_refused(sealed):
    folders, manifest = sealed
    (folders[1] / "case_d.json").write_text("{}", encoding="utf-8")
    with pytest.raises(InputError, match=r"case_d\.json"):
        load_ground_truth(folders, manifest)
    (folders[0] / "case_b.json").write_text('{"campaign": "case_c"}', encoding="utf-8")
    with pytest.raises(InputError, match=r"case_b\.json.*as sealed"):
        load_ground_truth(folders[:1], manifest)
