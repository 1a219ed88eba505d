"""Verdicts anew until a single name, and that nothing sealed is opened on the way."""

import json
import subprocess
import sys
from pathlib import Path

import pytest
from made_folders import made_folder, made_table

from elastocal_proof.blind.verdicts import ARMS, POSES, diagnosed_anew, folder_of

WATCHED = """
import json, sys
opened = []
sys.addaudithook(lambda event, details: opened.append(str(details[0])) if event == "open" else None)
from types import SimpleNamespace
from elastocal_proof.blind import follow_up, verdicts
from elastocal.loop.whole import diagnosed
blind, again, robots, path = sys.argv[1:]
params, wildcards = SimpleNamespace(robots=robots, seed=1), SimpleNamespace(block="b")
job = SimpleNamespace(input=SimpleNamespace(blind=blind), output=SimpleNamespace(verdicts=path), params=params)
job.wildcards = wildcards
verdicts.diagnose_cases(job)
(verdict,) = json.load(open(path))
effect = verdict["effects"][0]
anew = verdicts.diagnosed_anew(again, lambda path: diagnosed(path, robots, 1))
follow_up.POSES = (3,)
frame = follow_up.proposed(f"{blind}/case_1", robots, 1)
modules = [name for name in sys.modules if name.startswith(("elastocal_proof.plant", "elastocal_proof.blind.cases", "mujoco"))]
print(json.dumps({"opened": opened, "modules": modules, "states": len(frame), "said": effect, "anew": len(anew)}))
"""


def said(name, word, *alternatives):
    return {"campaign": name, "verdict": word, "effects": [{"alternatives": list(alternatives)}]}


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
