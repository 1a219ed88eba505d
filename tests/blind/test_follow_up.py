"""Which cases are followed up, when to stop, and that nothing sealed is opened on the way."""

import json
import subprocess
import sys

import pytest
from made_folders import made_folder, made_table

from elastocal_proof.blind.follow_up import ARMS, POSES, diagnosed_anew, diagnosed_until_named, folder_name, followed_up

WATCHED = """
import json, sys
opened = []
sys.addaudithook(lambda event, details: opened.append(str(details[0])) if event == "open" else None)
from elastocal_proof.blind.follow_up import diagnosed_anew
from elastocal_proof.blind.proposed import proposed
from elastocal.loop.whole import diagnosed
folder, again, robots = sys.argv[1:]
verdict = diagnosed(folder, robots, 1)
effect = verdict["effects"][0]
frame = proposed(folder, robots, 3, (0.0, 1.0), 1)
anew = diagnosed_anew(again, lambda path: diagnosed(path, robots, 1))
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


def test_more_is_measured_until_a_single_name_is_said():
    words = {"five": "class", "ten": "named", "twenty": "class"}
    verdicts = diagnosed_until_named({5: "five", 10: "ten", 20: "twenty"}, lambda folder: said(folder, words[folder]))
    assert {poses: verdict["verdict"] for poses, verdict in verdicts.items()} == {5: "class", 10: "named"}
    never = diagnosed_until_named({5: "five", 20: "twenty"}, lambda folder: said(folder, words[folder]))
    assert list(never) == [5, 20]


def test_each_case_of_a_block_is_diagnosed_anew_in_each_arm(tmp_path):
    for case in ("case_b", "case_a"):
        for arm in ARMS:
            for poses in POSES:
                (tmp_path / folder_name(arm, poses) / case).mkdir(parents=True)
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
def test_proposing_and_diagnosing_anew_open_no_sealed_file_and_know_no_plant(kuka, config_folder, tmp_path):
    table = made_table(kuka, "case_1", offset_of_joint_3=6e-4)
    folder = made_folder(tmp_path / "blind" / "case_1", kuka, "case_1", table=table)
    for arm in ARMS:
        for poses in POSES:
            made_folder(tmp_path / "again" / folder_name(arm, poses) / "case_1", kuka, "case_1", table=table)
    sealed = tmp_path / "sealed" / "case_1.json"
    sealed.parent.mkdir()
    sealed.write_text("{}", encoding="utf-8")
    again, robots = (tmp_path / "again").as_posix(), (config_folder / "robots").as_posix()
    command = [sys.executable, "-c", WATCHED, folder.as_posix(), again, robots]
    done = subprocess.run(command, capture_output=True, text=True)
    assert not done.returncode, done.stderr
    told = json.loads(done.stdout)
    assert told["anew"] >= 2 and told["states"] == (3 if told["said"]["alternatives"] else 0)
    assert sum(path.endswith("campaign.yaml") for path in told["opened"]) > 2
    assert not [path for path in told["opened"] if "sealed" in path]
    assert told["modules"] == []
