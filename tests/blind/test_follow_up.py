"""Which cases are followed up, and what the proposal of the next experiment is asked with."""

import numpy as np
import pytest
from made_folders import made_folder

from elastocal.campaigns.reading import read_campaign
from elastocal.diagnosis.next_experiment import Entries, Proposal
from elastocal_proof.blind import follow_up as module
from elastocal_proof.blind.follow_up import followed_up, proposed
from elastocal_proof.blind.verdicts import POSES


def said(name, word, *alternatives):
    return {"campaign": name, "verdict": word, "effects": [{"alternatives": list(alternatives)}]}


def test_the_first_classes_by_name_are_followed_up_whatever_the_order():
    verdicts = [said(name, "class", "payload") for name in "cdb"]
    # One is sure, and one doubts its law and has nothing to be told from.
    verdicts += [said("a", "named"), said("aa", "class")]
    assert [verdict["campaign"] for verdict in followed_up(verdicts, 2)] == ["b", "c"]
    assert followed_up(verdicts[3:], 2) == []


def made_proposal(joints, poses, ladder, draws):
    """Angles and loads anywhere, as a search would leave them."""
    count = np.arange(poses, dtype=float)
    wrench = np.tile([0.0, 0.0, -500.0, 0.0, 0.0, 0.0], (poses, 1))
    angles = draws.uniform(-1, 1, (poses, joints))
    entries = Entries(angles, wrench, None)
    return Proposal(("a",), nearest=("b",), entries=entries, shares=ladder, points=("6DoF",), separation=count, resolved=count)


@pytest.fixture
def asked(monkeypatch):
    """What the diagnosis and the search were asked, neither of which runs."""
    heard = []

    def diagnose(case, settings, seed):
        heard.append({"case": case, "diagnosis seed": seed})
        return "diagnosis"

    def propose(diagnosis, limits, settings, draws, poses, ladder):
        heard[-1] |= {"diagnosis": diagnosis, "limits": limits, "ladder": ladder}
        heard[-1]["proposal"] = made_proposal(len(limits), poses, ladder, draws)
        return heard[-1]["proposal"]

    monkeypatch.setattr(module, "diagnose", diagnose)
    monkeypatch.setattr(module, "propose", propose)
    return heard


@pytest.fixture
def folder(kuka, tmp_path):
    return made_folder(tmp_path / "case_1", kuka, "case_1", holdout={"poses": [2, 5]})


def test_no_held_out_pose_reaches_the_diagnosis_from_which_poses_are_proposed(asked, folder, config_folder):
    proposed(folder, config_folder / "robots", 4)
    everything = read_campaign(folder, config_folder / "robots").measurements
    seen = set(asked[0]["case"].observations.states.pose.tolist())
    assert seen == set(everything.pose.tolist()) - {2, 5}
    assert asked[0]["diagnosis seed"] == 4 and asked[0]["diagnosis"] == "diagnosis"


def test_as_many_poses_as_wanted_are_looked_for_within_the_joint_limits_on_the_given_ladder(asked, folder, config_folder, kuka):
    table = proposed(folder, config_folder / "robots", 4)
    np.testing.assert_array_equal(asked[0]["limits"], kuka.joint_limits)
    assert asked[0]["ladder"] == module.LADDER and len(table) == max(POSES)


def test_poses_follow_from_the_seed_and_differ_between_campaigns(asked, folder, config_folder, kuka, tmp_path):
    other = made_folder(tmp_path / "case_2", kuka, "case_2")
    first, again, seed, name = (
        proposed(where, config_folder / "robots", seed).q1.tolist()
        for where, seed in ((folder, 4), (folder, 4), (folder, 5), (other, 4))
    )
    assert first == again
    assert first != seed and first != name
