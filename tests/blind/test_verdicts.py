"""That the diagnosis of blind cases opens nothing sealed and knows no plant."""

import json
import subprocess
import sys

import pytest
from made_folders import make_folder, make_table

WATCHED = """
import json, sys
opened = []
sys.addaudithook(lambda event, details: opened.append(str(details[0])) if event == "open" else None)
from types import SimpleNamespace
from elastocal_proof.blind import verdicts
blind, robots, path = sys.argv[1:]
named = lambda **values: SimpleNamespace(**values)
params, wildcards = named(robots=robots, seed=1), named(block="b")
verdicts.diagnose_cases(named(input=named(blind=blind), output=named(verdicts=path), params=params, wildcards=wildcards))
modules = [name for name in sys.modules if name.startswith(("elastocal_proof.plant", "elastocal_proof.blind.cases", "mujoco"))]
print(json.dumps({"opened": opened, "modules": modules, "verdicts": len(json.load(open(path)))}))
"""


@pytest.mark.slow
def test_diagnosing_opens_no_sealed_file_and_knows_no_plant(
    kuka, config_folder, tmp_path
):
    table = make_table(kuka, "case_1", offset_of_joint_3=6e-4)
    make_folder(tmp_path / "blind" / "case_1", kuka, "case_1", table=table)
    (tmp_path / "sealed").mkdir()
    (tmp_path / "sealed" / "case_1.json").write_text("{}", encoding="utf-8")
    places = [
        (tmp_path / "blind").as_posix(),
        (config_folder / "robots").as_posix(),
        (tmp_path / "verdicts.json").as_posix(),
    ]
    done = subprocess.run(
        [sys.executable, "-c", WATCHED, *places], capture_output=True, text=True
    )
    assert not done.returncode, done.stderr
    told = json.loads(done.stdout)
    assert told["verdicts"] == 1 and any(
        path.endswith("campaign.yaml") for path in told["opened"]
    )
    assert not [path for path in told["opened"] if "sealed" in path]
    assert told["modules"] == []
