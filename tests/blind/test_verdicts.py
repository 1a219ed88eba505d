"""The diagnosis of blind cases opens no sealed file and imports no simulated robot."""

import json
import subprocess
import sys

import pytest
from made_folders import make_folder, make_table

# This program runs the step in a process of its own, and reports which files it opened
# and which modules it imported.
WATCHED = """
import json, sys
from types import SimpleNamespace
opened = []

def note_opened_file(event, details):
    if event == "open":
        opened.append(str(details[0]))

sys.addaudithook(note_opened_file)
from elastocal_proof.blind import verdicts
blind, robots, path = sys.argv[1:]
verdicts.diagnose_cases(
    SimpleNamespace(
        input=SimpleNamespace(blind=blind),
        output=SimpleNamespace(verdicts=path),
        params=SimpleNamespace(robots=robots, seed=1),
        wildcards=SimpleNamespace(block="b"),
    )
)
sealed_modules = ("elastocal_proof.plant", "elastocal_proof.blind.cases", "mujoco")
modules = [name for name in sys.modules if name.startswith(sealed_modules)]
count = len(json.load(open(path)))
print(json.dumps({"opened": opened, "modules": modules, "verdicts": count}))
"""


@pytest.mark.slow
def test_the_diagnosis_opens_no_sealed_file_and_imports_no_simulated_robot(
    kuka, config_folder, tmp_path
):
    table = make_table(kuka, "case_1", offset_of_joint_3=6e-4)
    make_folder(tmp_path / "blind" / "case_1", kuka, "case_1", table=table)
    (tmp_path / "sealed").mkdir()
    (tmp_path / "sealed" / "case_1.json").write_text("{}", encoding="utf-8")
    arguments = [
        (tmp_path / "blind").as_posix(),
        (config_folder / "robots").as_posix(),
        (tmp_path / "verdicts.json").as_posix(),
    ]
    process = subprocess.run(
        [sys.executable, "-c", WATCHED, *arguments], capture_output=True, text=True
    )
    assert not process.returncode, process.stderr
    report = json.loads(process.stdout)
    assert report["verdicts"] == 1
    assert any(path.endswith("campaign.yaml") for path in report["opened"])
    assert not [path for path in report["opened"] if "sealed" in path]
    assert report["modules"] == []
