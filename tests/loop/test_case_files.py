"""A campaign comes back from the files of step 1 as it was read from its folder."""

import numpy as np
import pytest
from made_folders import made_folder
from support import changed, refused

from elastocal.campaigns.columns import columns_of
from elastocal.io.json_files import write_json
from elastocal.io.storage import write_table
from elastocal.loop.case_files import load_case
from elastocal.loop.loading import load_campaign
from elastocal.loop.schemas import measurements


@pytest.fixture(scope="module")
def loaded(kuka, config_folder, tmp_path_factory):
    """Descriptions and training measurements of a campaign that declares an effect."""
    folder = made_folder(tmp_path_factory.mktemp("loop") / "made", kuka, declared=["joint_offset"])
    return load_campaign(folder, config_folder / "robots")[:2]


@pytest.fixture
def files(loaded, tmp_path):
    descriptions, training = loaded
    paths = tmp_path / "descriptions.json", tmp_path / "training.parquet"
    write_json(paths[0], descriptions)
    write_table(paths[1], measurements(6), [columns_of(training)], {})
    return paths


def test_the_case_has_the_measurements_and_the_description_of_the_folder(files, loaded):
    case, training = load_case(*files), loaded[1]
    for name in ("pose", "load", "joint_angles", "wrench", "position"):
        np.testing.assert_array_equal(getattr(case.campaign.measurements, name), getattr(training, name))
    assert case.campaign.name == "made" and case.campaign.noise == {"position_m": 6e-5}
    assert [target.name for target in case.model.targets] == ["3DoF", "6DoF"]


def test_repeats_are_averaged_and_nothing_declared_is_looked_for(files, loaded):
    case, training = load_case(*files), loaded[1]
    states = {(s, p, x) for s, p, x in zip(training.session, training.pose, training.load, strict=True)}
    assert len(case.observations.states) == len(states) < len(training)
    assert {effect.effect for effect in case.model.effects} >= {"joint_offset"}
    assert "joint_offset" not in {candidate.effect for candidate in case.candidates.values()}


def test_a_test_without_a_campaign_of_its_own_is_described_as_the_training(files):
    assert load_case(*files, "held_out").campaign.name == "made"


def test_a_test_of_another_campaign_has_the_description_of_that_campaign(files, loaded):
    descriptions = loaded[0]
    other = {key: descriptions[key] for key in ("source", "campaign", "robot")}
    other = changed(changed(other, ("campaign", "campaign"), "other"), ("campaign", "noise", "position_m"), 2e-5)
    write_json(files[0], descriptions | {"held_out": other})
    assert load_case(*files).campaign.name == "made"
    case = load_case(*files, "held_out")
    assert case.campaign.name == "other" and case.campaign.noise == {"position_m": 2e-5}


def test_measurements_of_a_robot_with_other_joints_are_refused_by_their_file(files, loaded):
    robot = loaded[0]["robot"]
    write_json(files[0], loaded[0] | {"robot": robot | {"chain": robot["chain"] + " Rz(q7) [more]"}})
    with refused(files[1], ""):
        load_case(*files)
