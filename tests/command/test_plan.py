"""A plan as files, and what is refused before any planning."""

import numpy as np
import pandas as pd
import pytest
import yaml
from analysed_robots import ROBOTS, analysed

from elastocal.application.calibrated import nominal_forward

PLAN = ("plan", ROBOTS / "ur10.yaml", "--candidates", 300, "--poses", 18, "--held-out", 4)


@pytest.fixture
def run(elastocal):
    return lambda *words: elastocal(*PLAN, *words)


def test_a_plan_is_a_table_a_picture_and_a_folder_to_fill_in(run, tmp_path):
    result = run("--folder", tmp_path / "cell", "--force", 80, "--pull", "--tracker", "3,1,1", "--box=-3,3,-3,3,-2,-0.5")
    assert result.exit_code == 0, result.output
    assert "18 poses to fit and 4 held out" in result.stderr
    assert {p.name for p in (tmp_path / "cell").iterdir()} == {
        *("campaign.yaml", "robot.yaml", "measurements.csv", "plan.csv", "plan.pdf", "plan.png")
    }
    assert yaml.safe_load((tmp_path / "cell" / "campaign.yaml").read_text())["holdout"] == {"poses": [19, 20, 21, 22]}
    table = pd.read_csv(tmp_path / "cell" / "plan.csv")
    assert (table["expected_accuracy_m"] > 0).all() and set(table["load"]) == {0, 1, 2}
    assert heights(table).min() > 0.0


def heights(table):
    """Of the end effector over the base plane at each row of a plan, m."""
    robot = analysed("ur10")
    return nominal_forward(robot, table[[f"q{joint}" for joint in range(1, 7)]].to_numpy())[0][:, 2]


def test_without_a_floor_poses_may_lie_below_the_base_and_with_one_where_it_is(run, tmp_path):
    """A third of all configurations of this arm has its tip below."""
    lowest = []
    for number, words in enumerate((["--no-floor"], ["--floor", "0.3"])):
        result = run("--output", tmp_path / f"{number}.csv", *words)
        assert result.exit_code == 0, result.output
        lowest.append(heights(pd.read_csv(tmp_path / f"{number}.csv")).min())
    assert lowest[0] < -0.1 and lowest[1] > 0.3


@pytest.mark.slow
def test_as_few_poses_as_reach_a_wanted_accuracy(run, tmp_path):
    many = ("--force", 80, "--pull", "--poses", 22, "--output", tmp_path / "few.csv")
    few = run(*many, "--accuracy", "0.5mm")
    assert few.exit_code == 0, few.output
    table = pd.read_csv(tmp_path / "few.csv")
    assert table["pose"].nunique() < 26
    assert table["expected_accuracy_m"][0] < 7e-4


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--criterion", "Z"], "--criterion"),
        (["--box", "1,2,3"], "--box"),
        (["--box", "1,0,0,1,0,1"], "--box"),
        (["--tracker", "1,2"], "--tracker"),
        (["--noise", "0.03"], "--noise"),
        (["--target", "elbow"], "--target"),
        (["--target", "A:elbow"], "'elbow'"),
        (["--target", "A:6DoF", "--target", "A:4DoF"], "'A' twice"),
        (["--target", "6DoF=0.1,0,0", "--target", "6DoF=0,0.1,0", "--target", "6DoF"], "A:6DoF and B:6DoF"),
        (["--target", ":6DoF"], "a name of 0"),
        (["--target", f"{'A' * 81}:6DoF"], "a name of 81"),
        (["--target", "=A:6DoF"], "--target"),
        (["--target", "A:6DoF="], "3 numbers"),
        (["--sensor", "ruler"], "tracker, t-mac, camera"),
        (["--sensor", "tracker", "--measured", "pose"], "--sensor t-mac, camera"),
        (["--measured", "angle"], "--measured"),
        (["--orientation-noise", "0.01deg"], "--measured pose"),
        (["--measured", "pose", "--orientation-noise", "0.01"], "with its unit"),
        (["--accuracy", "1um"], "--accuracy"),
        (["--box=-9,9,-9,9,-9,9"], "boxes"),
        (["--floor", "9"], "--no-floor"),
        (["--floor", "high"], "--floor"),
    ],
)
def test_a_wrong_option_is_refused_by_its_name_and_nothing_is_written(refusal, tmp_path, words, message):
    assert message in refusal(*PLAN, "--output", tmp_path / "plan.csv", *words)
    assert list(tmp_path.iterdir()) == []


def test_three_reflectors_on_one_flange_are_three_targets_of_their_sensor(run, tmp_path):
    words = [word for name in "ABC" for word in ("--target", f"{name}:6DoF=0.{ord(name) - 64},0,0")]
    result = run("--folder", tmp_path / "cell", "--sensor", "T-MAC", *words, "--target", "6DoF")
    assert result.exit_code == 0, result.exception
    assert "30 µm, 87.3 µrad" in result.stderr and "Leica" in result.stderr
    document = yaml.safe_load((tmp_path / "cell" / "campaign.yaml").read_text())
    assert {name: target["offset_m"] for name, target in document["targets"].items()} == {
        **{"A": [0.1, 0.0, 0.0], "B": [0.2, 0.0, 0.0], "C": [0.3, 0.0, 0.0], "6DoF": "unknown"}
    }
    assert document["measured"] == "pose"
    assert document["noise"] == {"position_m": 30e-6, "orientation_rad": pytest.approx(np.radians(0.005))}
    sheet = pd.read_csv(tmp_path / "cell" / "measurements.csv")
    assert set(sheet["target"].value_counts()) == {len(sheet) // 4} and set(sheet["target"]) == {"A", "B", "C", "6DoF"}


@pytest.mark.slow
def test_noise_that_is_stated_goes_before_that_of_the_sensor(run, tmp_path):
    words = ("--measured", "pose", "--noise", "50um", "--orientation-noise", "0.1mrad")
    assert run("--folder", tmp_path / "cell", *words).exit_code == 0
    document = yaml.safe_load((tmp_path / "cell" / "campaign.yaml").read_text())
    assert document["noise"] == {"position_m": pytest.approx(50e-6), "orientation_rad": pytest.approx(1e-4)}


def test_a_plan_needs_a_place_and_takes_no_one_elses(refusal, tmp_path):
    assert "neither --output nor --folder" in refusal(*PLAN)
    assert "a folder that is there" in refusal(*PLAN, "--folder", tmp_path)
