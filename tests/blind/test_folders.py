"""What the folder of a blind campaign holds, what it must not hold, and the sealed
record beside it."""

from types import SimpleNamespace

import numpy as np
import pytest
from analysed_robots import ROBOTS

from elastocal.campaigns.campaign_folder import read_campaign_folder
from elastocal.campaigns.holdout import split_poses
from elastocal.campaigns.reading import read_campaign
from elastocal.errors import InputError
from elastocal_proof.blind.folders import (
    load_ground_truth,
    seal_cases,
    write_blind_campaign,
    write_truth,
)
from elastocal_proof.plant.arm import read_arm
from elastocal_proof.plant.campaigns import Design, draw_schedule
from elastocal_proof.plant.simulated_robot import draw_specimen


@pytest.mark.parametrize("name", ["kuka", "fanuc", "abb"])
def test_the_analysis_reads_the_folder_its_angles_and_the_poses_that_are_held_out(
    tmp_path, name
):
    small = Design(poses=8, held_out=2, repeated_poses=3, repeats=2)
    robot = draw_specimen(read_arm(ROBOTS / f"{name}.yaml"), 1)
    write_blind_campaign(
        tmp_path / "c",
        "c",
        ROBOTS / f"{name}.yaml",
        robot,
        small,
        draw_schedule(robot.arm, small, 2),
    )
    campaign = read_campaign(read_campaign_folder(tmp_path / "c", ROBOTS))
    schedule = draw_schedule(robot.arm, small, 2)
    training, held_out = split_poses(campaign)
    assert set(training.pose) == set(schedule.pose[schedule.training])
    assert set(held_out.pose) == set(schedule.pose[~schedule.training])
    # Four targets a state.
    np.testing.assert_allclose(
        campaign.measurements.joint_angles[::4], schedule.angle, atol=1e-12
    )


def test_a_record_is_refused_anywhere_inside_the_campaigns_folder_however_the_path_is_written(
    tmp_path,
):
    folder = tmp_path / "blind" / "case0"
    for path in (
        folder / "deep" / "case0.json",
        folder / ".." / "case0" / "case0.json",
    ):
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
        (folder / f"{name}.json").write_text(
            f'{{"campaign": "{name}"}}', encoding="utf-8"
        )
    manifest = tmp_path / "manifest.sha256"
    seal_cases(
        SimpleNamespace(
            input=SimpleNamespace(sealed=folders),
            output=SimpleNamespace(manifest=manifest),
        )
    )
    return folders, manifest


def test_a_ground_truth_that_was_changed_or_not_published_is_refused(sealed):
    folders, manifest = sealed
    found = load_ground_truth(*sealed)
    assert found == {
        name: {"campaign": name} for name in ("case_a", "case_b")
    } and list(found) == ["case_a", "case_b"]
    (folders[1] / "case_d.json").write_text("{}", encoding="utf-8")
    with pytest.raises(InputError, match=r"case_d\.json"):
        load_ground_truth(folders, manifest)
    (folders[0] / "case_b.json").write_text('{"campaign": "case_c"}', encoding="utf-8")
    with pytest.raises(InputError, match=r"case_b\.json.*as sealed"):
        load_ground_truth(folders[:1], manifest)
