"""A campaign's folder: begun, checked, and diagnosed by its Snakemake target."""

import io
import time

import numpy as np
import pytest
from analysed_robots import analysed
from made_folders import make_folder, make_table
from rich.console import Console

from elastocal.campaigns.campaign_folder import read_campaign_folder
from elastocal.command import campaign, diagnosis_runs

ROBOT = "name: arm\nchain: Rz(q1) Tx(1.0) [tip]\n"


def test_a_new_folder_is_a_campaign_without_measurements(elastocal, refusal, tmp_path):
    cell = tmp_path / "cell"
    assert "no robot file" in refusal("init", cell) and not cell.exists()
    (tmp_path / "robot.yaml").write_text(ROBOT)
    result = elastocal("init", cell, "--robot", tmp_path / "robot.yaml")
    assert result.exit_code == 0
    names = {path.name for path in cell.iterdir()}
    assert names == {"campaign.yaml", "robot.yaml", "measurements.csv"}
    folder = read_campaign_folder(cell, tmp_path)
    assert folder.document["campaign"] == "cell"
    assert folder.robot_file.read_text() == ROBOT


def test_no_file_that_exists_is_replaced(elastocal, refusal, tmp_path):
    (tmp_path / "robot.yaml").write_text(ROBOT)
    sheet = tmp_path / "measurements.csv"
    sheet.write_text("pose,load,repeat,target\n")
    assert "already" in refusal("init", tmp_path, "--robot", tmp_path / "robot.yaml")
    assert elastocal("init", tmp_path).exit_code == 0
    assert sheet.read_text() == "pose,load,repeat,target\n"
    assert "point: tip" in (tmp_path / "campaign.yaml").read_text()
    assert refusal("init", tmp_path)


@pytest.fixture
def import_table(elastocal, tmp_path):
    """Imports nine poses of a target into the folder of a robot."""
    (tmp_path / "robot.yaml").write_text(ROBOT)

    def run(target, *options):
        table = tmp_path / "t.csv"
        rows = "".join(f"{angle},1,2,3,0,0,0,{target}\n" for angle in range(9))
        table.write_text(f"q1,x,y,z,rx,ry,rz,target\n{rows}")
        units = ("--angles", "deg", "--lengths", "m", "--rotation", "vector")
        result = elastocal(
            "import", "csv", table, "--folder", tmp_path, *units, *options
        )
        assert result.exit_code == 0
        return result.output

    return run


def test_a_new_campaign_has_the_targets_of_its_measurements(
    import_table, elastocal, tmp_path
):
    import_table("TCP")
    result = elastocal("init", tmp_path)
    assert result.exit_code == 0 and "fill in" not in result.output
    document = read_campaign_folder(tmp_path, tmp_path).document
    assert document["measured"] == "pose"
    assert document["targets"] == {"TCP": {"point": "tip", "offset_m": "unknown"}}


def test_imported_targets_are_compared_with_those_of_the_campaign(
    import_table, elastocal, tmp_path
):
    import_table("TCP")
    assert elastocal("init", tmp_path).exit_code == 0
    assert "! campaign.yaml" not in import_table("TCP", "--force")
    assert "has no target SMR" in import_table("SMR", "--force")


def test_a_sheet_without_a_header_is_refused(refusal, tmp_path):
    (tmp_path / "robot.yaml").write_text(ROBOT)
    (tmp_path / "measurements.csv").write_text("mine")
    assert "a header with pose" in refusal("init", tmp_path)


def test_a_check_says_what_was_read_identified_and_testable(elastocal, tmp_path):
    folder = make_folder(tmp_path / "made", analysed("kuka"))
    result = elastocal("check", folder)
    assert result.exit_code == 0, result.output
    answer, *details = result.output.splitlines()
    assert answer.startswith("✓ made can be diagnosed: ")
    for topic in ("read", "validation poses", "noise", "declared model", "testable"):
        assert any(topic in line for line in details), topic
    assert any(line.startswith("! ") for line in details)
    assert details[-1] == f"next: elastocal diagnose {folder}"


def test_a_check_refuses_the_name_of_a_campaign_of_the_project(refusal, tmp_path):
    """`diagnose` would refuse it."""
    folder = make_folder(tmp_path / "cell", analysed("kuka"), name="ur5_grid")
    assert "'ur5_grid', a campaign of elastocal" in refusal("check", folder)


def test_faults_of_the_data_end_in_exit_code_one(elastocal, tmp_path):
    robot = analysed("kuka")
    table = make_table(robot, "made")
    table["q3"] = -table["q3"]
    result = elastocal("check", make_folder(tmp_path / "made", robot, table=table))
    assert result.exit_code == 1 and "next: mend the data" in result.output
    answer = "! made cannot be diagnosed: the data are at fault"
    assert result.output.startswith(answer) and "joint 3" in result.output


def test_an_empty_cell_is_refused_with_its_line(refusal, tmp_path):
    robot = analysed("kuka")
    table = {
        name: np.asarray(values).astype(object)
        for name, values in make_table(robot, "made").items()
    }
    table["x"][3] = ""
    folder = make_folder(tmp_path / "empty", robot, table=table)
    assert "line 5, column x: found nothing" in refusal("check", folder)


@pytest.fixture
def diagnose(elastocal, tmp_path, monkeypatch):
    """Diagnoses a campaign with a stand-in for Python, which prints its arguments and
    where it runs, and ends with an exit code."""

    def run(pipeline, exit_code=0):
        stand_in = tmp_path / "python"
        stand_in.write_text(f'#!/bin/sh\necho "$PWD" "$@"\nexit {exit_code}\n')
        stand_in.chmod(0o755)
        monkeypatch.setattr(diagnosis_runs.sys, "executable", str(stand_in))
        monkeypatch.setattr(diagnosis_runs, "find_pipeline", lambda: pipeline)
        monkeypatch.setattr(campaign, "find_workplace", lambda: tmp_path)
        return elastocal("diagnose", tmp_path / "cell7", "-j", 1)

    return run


def test_diagnose_runs_the_target_of_the_campaign_and_returns_its_exit_code(
    tmp_path, diagnose
):
    command = f"{tmp_path} -m snakemake -j1 diagnose --config campaign={tmp_path}/cell7"
    for exit_code in (0, 3):
        result = diagnose(tmp_path, exit_code)
        assert result.exit_code == exit_code and result.stderr.strip() == command
    installed = tmp_path / "installed"
    with_snakefile = f"{command} --snakefile {installed}/Snakefile"
    assert diagnose(installed).stderr.strip() == with_snakefile


@pytest.mark.parametrize(
    "mark", ["{x}", "<x>", "'", '"', ": ", " #", "\n", "\x1b", "\u202e"]
)
@pytest.mark.parametrize("command", ["check", "diagnose"])
def test_a_path_that_snakemake_takes_for_something_else_is_refused(
    refusal, tmp_path, mark, command
):
    assert "a path without it" in refusal(command, f"{tmp_path}/a{mark}b")


@pytest.mark.parametrize("name", ["cell'", "cell "])
def test_a_folder_is_not_taken_for_its_neighbour(refusal, tmp_path, name):
    """Snakemake removes quotes and blanks at the ends of a value."""
    assert "a path without it" in refusal("diagnose", tmp_path / name)


def test_a_terminal_shows_for_how_long_the_last_step_has_been_at_work():
    """The line moves between the lines of the run, and files get none of it."""

    def slow_lines():
        yield "Using workflow specific profile x\n"
        yield "2 of 6: diagnose_campaign cell\n"
        time.sleep(1.2)
        yield "Nothing to be done.\n"

    shown = io.StringIO()
    terminal = Console(file=shown, force_terminal=True, width=80)
    assert campaign._follow_run(slow_lines(), terminal)
    assert shown.getvalue().count("2 of 6: diagnose_campaign cell") > 3
    assert "0:00:01" in shown.getvalue()
    written = io.StringIO()
    assert campaign._follow_run(slow_lines(), Console(file=written))
    lines = written.getvalue().splitlines()
    assert lines == ["2 of 6: diagnose_campaign cell", "Nothing to be done."]
