"""Bad input to an example ends in the one line alone."""

import subprocess
import sys

import pytest
from durations import HUNG_S
from study_folder import REPOSITORY

CAMPAIGN = "campaign: cell\nrobot: kuka\nmeasured: pose\nframe: base\ntargets:\n  E: {point: POINT, offset_m: [0, 0, 0]}\n"
EXAMPLES = {
    "simulate_measurements.py": ["FOLDER", "config/robots/kuka_extended.yaml"],
    "rehearse.py": ["measure", "FOLDER"],
}


def ended(script, folder):
    words = [word.replace("FOLDER", str(folder)) for word in EXAMPLES[script]]
    command = [sys.executable, f"workflow/examples/{script}", *words]
    return subprocess.run(command, cwd=REPOSITORY, capture_output=True, text=True, timeout=HUNG_S)


@pytest.mark.parametrize("script", EXAMPLES)
def test_a_folder_without_a_campaign_is_one_line(script, tmp_path):
    done = ended(script, tmp_path)
    line = f"{tmp_path}/campaign.yaml: found no such file; allowed: the path of a readable file\n"
    assert (done.returncode, done.stderr) == (1, line)


def test_a_point_that_the_measured_robot_does_not_have_is_one_line(tmp_path):
    document = tmp_path / "campaign.yaml"
    document.write_text(CAMPAIGN.replace("POINT", "7DoF"), encoding="utf-8")
    done = ended("simulate_measurements.py", tmp_path)
    assert done.returncode == 1 and done.stderr.startswith(f"{document}: targets.E.point: found '7DoF'; allowed: ")
    assert len(done.stderr.splitlines()) == 1
    document.write_text(CAMPAIGN.replace("POINT", "6DoF"), encoding="utf-8")
    assert ended("simulate_measurements.py", tmp_path).returncode == 0
