"""A campaign's folder: begun, checked, and handed to its Snakemake target."""

import numpy as np
import pytest
from analysed_robots import analysed
from made_folders import made_folder, made_table

from elastocal.campaigns.campaign_folder import read_campaign_folder
from elastocal.command import campaign

ARM = "name: arm\nchain: Rz(q1) Tx(1.0) [tip]\n"


def test_a_new_folder_is_a_campaign_that_lacks_measurements_and_what_is_there_stays(
    elastocal, refusal, tmp_path
):
    assert (
        "no robot file" in refusal("init", tmp_path / "cell")
        and not (tmp_path / "cell").exists()
    )
    (tmp_path / "robot.yaml").write_text(ARM)
    assert (
        elastocal(
            "init", tmp_path / "cell", "--robot", tmp_path / "robot.yaml"
        ).exit_code
        == 0
    )
    assert {path.name for path in (tmp_path / "cell").iterdir()} == {
        "campaign.yaml",
        "robot.yaml",
        "measurements.csv",
    }
    folder = read_campaign_folder(tmp_path / "cell", tmp_path)
    document = folder.document
    robot = folder.robot_file
    assert document["campaign"] == "cell" and robot.read_text() == ARM
    (tmp_path / "measurements.csv").write_text("pose,load,repeat,target\n")
    assert "already" in refusal("init", tmp_path, "--robot", tmp_path / "robot.yaml")
    assert elastocal("init", tmp_path).exit_code == 0
    assert (tmp_path / "measurements.csv").read_text() == "pose,load,repeat,target\n"
    assert "point: tip" in (tmp_path / "campaign.yaml").read_text()
    assert refusal("init", tmp_path)


def test_targets_are_those_of_the_measurements_that_lie_there(
    elastocal, refusal, tmp_path
):
    (tmp_path / "robot.yaml").write_text(ARM)
    (tmp_path / "t.csv").write_text(
        "q1,x,y,z,rx,ry,rz,target\n"
        + "".join(f"{n},1,2,3,0,0,0,TCP\n" for n in range(9))
    )
    words = (
        "--folder",
        tmp_path,
        "--angles",
        "deg",
        "--lengths",
        "m",
        "--rotation",
        "vector",
    )
    assert elastocal("import", "csv", tmp_path / "t.csv", *words).exit_code == 0
    result = elastocal("init", tmp_path)
    assert result.exit_code == 0 and "fill in" not in result.output
    document = read_campaign_folder(tmp_path, tmp_path).document
    assert (document["measured"], document["targets"]) == (
        "pose",
        {"TCP": {"point": "tip", "offset_m": "unknown"}},
    )
    # The other way round: what is imported beside a campaign is compared with it.
    assert (
        "! campaign.yaml"
        not in elastocal("import", "csv", tmp_path / "t.csv", *words, "--force").output
    )
    (tmp_path / "t.csv").write_text(
        (tmp_path / "t.csv").read_text().replace("TCP", "SMR")
    )
    again = elastocal("import", "csv", tmp_path / "t.csv", *words, "--force")
    assert again.exit_code == 0 and "has no target SMR" in again.output
    (tmp_path / "campaign.yaml").unlink()
    (tmp_path / "measurements.csv").write_text("mine")
    assert "a header with pose" in refusal("init", tmp_path)


def test_a_check_says_what_was_read_identified_and_testable(elastocal, tmp_path):
    folder = made_folder(tmp_path / "made", analysed("kuka"))
    result = elastocal("check", folder)
    assert result.exit_code == 0, result.output
    answer, *rest = result.output.splitlines()
    assert answer.startswith("✓ made can be diagnosed: ")
    for words in ("read", "validation poses", "noise", "declared model", "testable"):
        assert any(line.startswith(f"  {words}") or words in line for line in rest), (
            words
        )
    assert any(line.startswith("! ") for line in rest)
    assert rest[-1] == f"next: elastocal diagnose {folder}"


def test_faults_of_the_data_end_in_exit_code_one_and_an_empty_sheet_is_refused_with_its_row(
    elastocal, refusal, tmp_path
):
    table = made_table(analysed("kuka"), "made")
    result = elastocal(
        "check",
        made_folder(
            tmp_path / "made", analysed("kuka"), table=table | {"q3": -table["q3"]}
        ),
    )
    assert result.exit_code == 1 and "next: mend the data" in result.output
    assert (
        result.output.startswith("! made cannot be diagnosed: the data are at fault")
        and "joint 3" in result.output
    )
    table = {name: values.astype(object) for name, values in table.items()}
    table["x"][3] = ""
    folder = made_folder(
        tmp_path / "empty",
        analysed("kuka"),
        table={k: np.asarray(v) for k, v in table.items()},
    )
    assert "line 5, column x: found nothing" in refusal("check", folder)


@pytest.fixture
def run(elastocal, tmp_path, monkeypatch):
    """Diagnose a campaign with a pipeline and in a workplace; what is called, and the
    exit code of that."""

    def called(pipeline, code=0, prints=""):
        # In place of Python: shows its arguments and where it runs.
        stand_in = tmp_path / "python"
        stand_in.write_text(
            f'#!/bin/sh\necho "$PWD" "$@"\necho "{prints}"\nexit {code}\n'
        )
        stand_in.chmod(0o755)
        monkeypatch.setattr(campaign.sys, "executable", str(stand_in))
        monkeypatch.setattr(campaign, "find_pipeline", lambda: pipeline)
        monkeypatch.setattr(campaign, "find_workplace", lambda: tmp_path)
        return elastocal("diagnose", tmp_path / "cell7", "-j", 1)

    return called


def test_the_target_of_the_campaign_runs_where_the_pipeline_is_and_its_exit_code_counts(
    tmp_path, run
):
    called = f"{tmp_path} -m snakemake -j1 diagnose --config campaign={tmp_path}/cell7"
    for code in (0, 3):
        result = run(tmp_path, code)
        assert result.exit_code == code and result.stderr.strip() == called
    assert (
        run(tmp_path / "installed").stderr.strip()
        == f"{called} --snakefile {tmp_path}/installed/Snakefile"
    )


@pytest.mark.parametrize("mark", ["{x}", ": ", " #", "\n", "\x1b", "\u202e"])
def test_a_path_that_snakemake_takes_for_something_else_is_refused(
    refusal, tmp_path, mark
):
    assert "a path without it" in refusal("diagnose", f"{tmp_path}/a{mark}b")
