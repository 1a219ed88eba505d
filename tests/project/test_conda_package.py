"""The conda package of recipe/ is built, is installed in an empty environment, and runs
there."""

import subprocess
from pathlib import Path

import pytest
import yaml

import elastocal

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.slow
def test_the_package_of_the_recipe_runs_in_an_empty_environment():
    """With empty packages in place of conda-forge's, since no network is needed here:
    names and versions of the recipe must still have a solution."""
    command = ["make", "conda", "CHANNELS=stand-in"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]
    lines = done.stdout.splitlines()
    assert any(f"built elastocal-{elastocal.__version__}-" in line for line in lines)
    assert any(line.startswith("installed elastocal ") for line in lines)
    assert lines[-1].startswith("not installed:")


def test_ci_builds_the_package_from_the_real_channels():
    workflow = (ROOT / ".github/workflows/ci.yml").read_text(encoding="utf-8")
    steps = yaml.safe_load(workflow)["jobs"]["conda"]["steps"]
    assert steps[-1] == {"run": "make conda"}
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    assert "CHANNELS ?= conda-forge bioconda\n" in makefile
