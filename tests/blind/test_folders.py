"""What the folder of a blind campaign holds, what it must not hold, and the sealed
documents outside of it."""

from types import SimpleNamespace

import numpy as np
import pytest
from analysed_robots import ROBOTS

from elastocal.campaigns.campaign_folder import read_campaign_folder
from elastocal.campaigns.holdout import split_poses
from elastocal.campaigns.reading import read_campaign
from elastocal.errors import InputError
from elastocal_proof.blind.folders import (
    Experiment,
    load_ground_truth,
    seal_cases,
    write_blind_campaign,
    write_truth,
)
from elastocal_proof.plant.arm import read_arm
from elastocal_proof.plant.campaigns import Design, draw_schedule
from elastocal_proof.plant.simulated_robot import draw_specimen


@pytest.mark.parametrize("name", ["kuka", "fanuc", "abb"])
def test_the_analysis_reads_the_angles_and_the_held_out_poses_of_the_schedule(
    tmp_path, name
):
    design = Design(poses=8, held_out=2, repeated_poses=3, repeats=2)
    robot_file = ROBOTS / f"{name}.yaml"
    robot = draw_specimen(read_arm(robot_file), 1)
    schedule = draw_schedule(robot.arm, design, 2)
    folder = tmp_path / "campaign"
    write_blind_campaign(
        folder, "campaign", robot_file, Experiment(robot, design, schedule)
    )
    campaign = read_campaign(read_campaign_folder(folder, ROBOTS))
    training, held_out = split_poses(campaign)
    assert set(training.pose) == set(schedule.pose[schedule.training])
    assert set(held_out.pose) == set(schedule.pose[~schedule.training])
    # Each state has four targets.
    np.testing.assert_allclose(
        campaign.measurements.joint_angles[::4], schedule.angle, atol=1e-12
    )


@pytest.mark.parametrize(
    "path", ["blind/case0/deep/case0.json", "blind/case0/../case0/case0.json"]
)
def test_a_ground_truth_is_refused_anywhere_inside_the_campaigns_folder(tmp_path, path):
    with pytest.raises(ValueError, match="must not lie"):
        write_truth(tmp_path / path, {}, tmp_path / "blind" / "case0")


def test_a_ground_truth_may_lie_in_a_folder_whose_name_begins_alike(tmp_path):
    path = tmp_path / "blind" / "case00" / "case0.json"
    assert write_truth(path, {}, tmp_path / "blind" / "case0")


@pytest.fixture
def sealed(tmp_path):
    """Two ground truths in two folders, and their published manifest."""
    folders = [tmp_path / "one", tmp_path / "two"]
    for folder, name in zip(folders, ("case_b", "case_a"), strict=True):
        folder.mkdir()
        truth = f'{{"campaign": "{name}"}}'
        (folder / f"{name}.json").write_text(truth, encoding="utf-8")
    manifest = tmp_path / "manifest.sha256"
    seal_cases(
        SimpleNamespace(
            input=SimpleNamespace(sealed=folders),
            output=SimpleNamespace(manifest=manifest),
        )
    )
    return folders, manifest


def test_ground_truths_are_loaded_in_the_order_of_their_names(sealed):
    truths = load_ground_truth(*sealed)
    assert truths == {name: {"campaign": name} for name in ("case_a", "case_b")}
    assert list(truths) == ["case_a", "case_b"]


def test_a_ground_truth_that_was_changed_or_not_published_is_refused(sealed):
    folders, manifest = sealed
    (folders[1] / "case_d.json").write_text("{}", encoding="utf-8")
    with pytest.raises(InputError, match=r"case_d\.json"):
        load_ground_truth(folders, manifest)
    (folders[0] / "case_b.json").write_text('{"campaign": "case_c"}', encoding="utf-8")
    with pytest.raises(InputError, match=r"case_b\.json.*as sealed"):
        load_ground_truth(folders[:1], manifest)
