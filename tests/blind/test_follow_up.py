"""Which cases are followed up, when to stop, and that nothing sealed is opened on the way."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from made_folders import made_folder, made_table

from elastocal.campaigns.reading import read_campaign
from elastocal.diagnosis.proposal import Proposal
from elastocal_proof.blind import follow_up as module
from elastocal_proof.blind.follow_up import ARMS, POSES, diagnosed_anew, folder_of, followed_up, proposed

WATCHED = """
import json, sys
opened = []
sys.addaudithook(lambda event, details: opened.append(str(details[0])) if event == "open" else None)
from types import SimpleNamespace
from elastocal_proof.blind import follow_up
from elastocal.loop.whole import diagnosed
blind, again, robots, verdicts = sys.argv[1:]
params, wildcards = SimpleNamespace(robots=robots, seed=1), SimpleNamespace(block="b")
job = SimpleNamespace(input=SimpleNamespace(blind=blind), output=SimpleNamespace(verdicts=verdicts), params=params)
job.wildcards = wildcards
follow_up.diagnose_cases(job)
(verdict,) = json.load(open(verdicts))
effect = verdict["effects"][0]
anew = follow_up.diagnosed_anew(again, lambda path: diagnosed(path, robots, 1))
follow_up.POSES = (3,)
frame = follow_up.proposed(f"{blind}/case_1", robots, 1)
modules = [name for name in sys.modules if name.startswith(("elastocal_proof.plant", "elastocal_proof.blind.cases", "mujoco"))]
print(json.dumps({"opened": opened, "modules": modules, "states": len(frame), "said": effect, "anew": len(anew)}))
"""


def said(name, word, *alternatives):
    return {"campaign": name, "verdict": word, "effects": [{"alternatives": list(alternatives)}]}


def test_the_first_classes_by_name_are_followed_up_whatever_the_order():
    verdicts = [said(name, "class", "payload") for name in "cdb"]
    # One is sure, and one doubts its law and has nothing to be told from.
    verdicts += [said("a", "named"), said("aa", "class")]
    assert [verdict["campaign"] for verdict in followed_up(verdicts, 2)] == ["b", "c"]
    assert followed_up(verdicts[3:], 2) == []


def test_each_case_of_a_block_is_diagnosed_anew_in_each_arm(tmp_path):
    for case in ("case_b", "case_a"):
        for arm in ARMS:
            for poses in POSES:
                Path(folder_of(tmp_path, arm, poses, case)).mkdir(parents=True)
    looked = []

    def diagnose(folder):
        looked.append(folder)
        return said(folder.rsplit("/", 1)[1], "named" if "proposed" in folder else "class")

    anew = diagnosed_anew(tmp_path.as_posix(), diagnose)
    keys = [(entry["campaign"], entry["arm"], entry["poses"]) for entry in anew]
    one = [("proposed", POSES[0]), *(("random", poses) for poses in POSES)]
    assert keys == [(case, *rest) for case in ("case_a", "case_b") for rest in one]
    assert all(entry["verdict"]["campaign"] == entry["campaign"] for entry in anew)
    assert len(looked) == len(anew)
    assert diagnosed_anew((tmp_path / "nothing").as_posix(), diagnose) == []


@pytest.mark.slow
def test_diagnosing_proposing_and_diagnosing_anew_open_no_sealed_file_and_know_no_plant(kuka, config_folder, tmp_path):
    table = made_table(kuka, "case_1", offset_of_joint_3=6e-4)
    made_folder(tmp_path / "blind" / "case_1", kuka, "case_1", table=table)
    for arm in ARMS:
        for poses in POSES:
            made_folder(Path(folder_of(tmp_path / "again", arm, poses, "case_1")), kuka, "case_1", table=table)
    sealed = tmp_path / "sealed" / "case_1.json"
    sealed.parent.mkdir()
    sealed.write_text("{}", encoding="utf-8")
    again, robots = (tmp_path / "again").as_posix(), (config_folder / "robots").as_posix()
    verdicts = (tmp_path / "verdicts.json").as_posix()
    command = [sys.executable, "-c", WATCHED, (tmp_path / "blind").as_posix(), again, robots, verdicts]
    done = subprocess.run(command, capture_output=True, text=True)
    assert not done.returncode, done.stderr
    told = json.loads(done.stdout)
    assert told["anew"] >= 2 and told["states"] == (3 if told["said"]["alternatives"] else 0)
    assert sum(path.endswith("campaign.yaml") for path in told["opened"]) > 2
    assert not [path for path in told["opened"] if "sealed" in path]
    assert told["modules"] == []


def made_proposal(joints, poses, ladder, draws):
    """Angles and loads anywhere, as a search would leave them."""
    count = np.arange(poses, dtype=float)
    wrench = np.tile([0.0, 0.0, -500.0, 0.0, 0.0, 0.0], (poses, 1))
    angles = draws.uniform(-1, 1, (poses, joints))
    return Proposal(
        angles, wrench, None, np.zeros(poses, bool), ladder, ("6DoF",), count, count, 1.0, 9, ("a",), ("b",), (), ""
    )


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
