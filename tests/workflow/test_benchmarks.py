"""Every benchmark in its small setting: that it runs, lest it rot, and not how fast,
which `make bench` measures."""

import re
import runpy
import shutil
import subprocess
import sys

import pytest
from durations import HUNG_S
from study_folder import REPOSITORY

pytestmark = pytest.mark.slow
BENCHMARKS = REPOSITORY / "benchmarks"
RUN = runpy.run_path(str(BENCHMARKS / "run.py"))


def ended(script, *arguments):
    command = [sys.executable, str(BENCHMARKS / script), *map(str, arguments)]
    done = subprocess.run(
        command, cwd=REPOSITORY, capture_output=True, text=True, timeout=HUNG_S
    )
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]
    return done.stdout


@pytest.fixture(scope="module")
def said():
    """What all of them print in one run, in which the rerun finds the study made; no
    report is touched."""
    kept = RUN["REPORT"].read_bytes() if RUN["REPORT"].exists() else None
    yield ended("run.py", "--small", "--only", *RUN["NAMES"])
    assert (RUN["REPORT"].read_bytes() if RUN["REPORT"].exists() else None) == kept


@pytest.mark.parametrize("name", RUN["NAMES"])
def test_a_small_setting_has_a_ratio_for_each_row(name, said):
    ratios = [
        float(ratio)
        for ratio in re.findall(
            rf"^  {name}\b.*: ratio (\S+), target none", said, re.MULTILINE
        )
    ]
    assert ratios and min(ratios) > 0 and max(ratios) < float("inf")


def test_the_cost_of_a_finished_run_is_stated(small_study, tmp_path):
    proof = tmp_path / "proof"
    shutil.copytree(small_study.path("results/timings"), proof / "results" / "timings")
    (proof / "data" / "blind" / "block" / "case").mkdir(parents=True)
    said = ended(
        "cost.py", small_study.folder, small_study.folder, proof, "--data-sets", 12, 24
    )
    cost = re.search(r"^\| blind case \| (\S+) \|", said, re.MULTILINE)
    assert float(cost[1]) > 0 and "from 12 and 24 data sets, 1 cases" in said


def test_the_rates_of_slipping_stands_are_stated():
    printed = ended("pushed_stands.py", 2, 9200)
    # The first robot has a stand that does not move, the second one that slips.
    assert "still: slipping stand stated: 0 of 1" in printed
    assert "slips: slipping stand stated: 1 of 1" in printed


def test_the_rates_of_an_instrument_are_stated_with_their_intervals():
    printed = ended("instruments.py", 2, 1, "plane")
    # One robot without an effect, which is right, and one with an effect.
    assert "| plane | 0 of 1: 0.00 % (0.00-97.50) | 1 of 1" in printed
