"""A plan as files, and what is refused before any planning."""

import pandas as pd
import pytest
import yaml
from analysed_robots import ROBOTS
from typer.testing import CliRunner

from elastocal.command.main import app
from elastocal.errors import InputError

ROBOT = str(ROBOTS / "ur10.yaml")


def run(*words):
    return CliRunner().invoke(app, ["plan", ROBOT, "--candidates", "300", "--poses", "18", "--held-out", "4", *map(str, words)])


def test_a_plan_is_a_table_a_picture_and_a_folder_to_fill_in(tmp_path):
    result = run("--folder", tmp_path / "cell", "--force", 80, "--pull", "--tracker", "3,1,1", "--box=-3,3,-3,3,-2,-0.5")
    assert result.exit_code == 0, result.output
    assert "18 poses to fit and 4 held out" in result.stderr
    assert {p.name for p in (tmp_path / "cell").iterdir()} == {
        *("campaign.yaml", "robot.yaml", "measurements.csv", "plan.csv", "plan.pdf", "plan.png")
    }
    assert yaml.safe_load((tmp_path / "cell" / "campaign.yaml").read_text())["holdout"] == {"poses": [19, 20, 21, 22]}
    table = pd.read_csv(tmp_path / "cell" / "plan.csv")
    assert (table["expected_accuracy_m"] > 0).all() and set(table["load"]) == {0, 1, 2}


def test_as_few_poses_as_reach_a_wanted_accuracy(tmp_path):
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
        (["--accuracy", "1um"], "--accuracy"),
        (["--box=-9,9,-9,9,-9,9"], "boxes"),
    ],
)
def test_a_wrong_option_is_refused_by_its_name_and_nothing_is_written(tmp_path, words, message):
    result = run("--output", tmp_path / "plan.csv", *words)
    assert isinstance(result.exception, InputError)
    assert message in str(result.exception)
    assert list(tmp_path.iterdir()) == []


def test_a_plan_needs_a_place_and_takes_no_one_elses(tmp_path):
    assert isinstance(run().exception, InputError)
    assert "a folder that is there" in str(run("--folder", tmp_path).exception)
