"""`elastocal plan`: a campaign to fill in, and options that are refused before any
planning."""

import re

import numpy as np
import pandas as pd
import pytest
import yaml
from analysed_robots import ROBOTS, analysed
from scipy.spatial.transform import Rotation

from elastocal.application.calibrated import compute_nominal_poses

PLAN = (
    "plan",
    ROBOTS / "ur10.yaml",
    "--candidates",
    300,
    "--poses",
    18,
    "--held-out",
    4,
)
FILES = {"campaign.yaml", "robot.yaml", "measurements.csv", "plan.pdf", "plan.png"}


@pytest.fixture
def plan(elastocal, tmp_path):
    """Makes a plan; returns its answer, its campaign.yaml and its sheet."""
    folder = tmp_path / "cell"

    def run(*options):
        result = elastocal(*PLAN, "--folder", folder, *options)
        assert result.exit_code == 0, result.exception
        document = yaml.safe_load((folder / "campaign.yaml").read_text())
        return result.stderr, document, pd.read_csv(folder / "measurements.csv")

    return run


def compute_positions(sheet):
    """Position of the end effector in each row of a sheet, (N, 3), m."""
    commands = sheet[[f"q{joint}" for joint in range(1, 7)]].to_numpy()
    return compute_nominal_poses(analysed("ur10"), commands)[0]


@pytest.mark.drawn
def test_a_plan_is_a_folder_to_fill_in_with_its_pages(
    plan, elastocal, refusal, tmp_path
):
    load = ("--force", 80, "--pull")
    cell = ("--tracker", "3,1,1", "--box=-3,3,-3,3,-2,-0.5", "--base-known")
    answer, document, sheet = plan(*load, *cell, "--target", "6DoF=0,0,0")
    assert "18 poses to fit and 4 held out" in answer
    assert "next: measure, then elastocal import csv tracker.csv" in answer
    assert {path.name for path in (tmp_path / "cell").iterdir()} == FILES
    assert document["holdout"] == {"poses": [19, 20, 21, 22]}
    assert document["frame"] == "base"
    positions = compute_positions(sheet)
    assert set(sheet["load"]) == {0, 1, 2} and positions[:, 2].min() > 0.0
    assert "found nothing" in refusal("check", tmp_path / "cell")
    assert "a folder that is there" in refusal(*PLAN, "--folder", tmp_path)
    # The sheet can be checked once it is filled in.
    noise = 3e-5 * np.random.default_rng(1).standard_normal(positions.shape)
    x, y, z = (positions + noise).T
    filled = sheet.assign(done="x", x=x, y=y, z=z)
    filled.to_csv(tmp_path / "cell" / "measurements.csv", index=False)
    assert elastocal("check", tmp_path / "cell").exit_code == 0


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--box", "1,0,0,1,0,1"], "--box"),
        (["--tracker", "1,2"], "--tracker"),
        (["--noise", "0.03"], "--noise"),
        (["--target", "elbow"], "--target"),
        (["--target", "A:6DoF", "--target", "A:4DoF"], "'A' twice"),
        (
            [
                "--target",
                "6DoF=0.1,0,0",
                "--target",
                "6DoF=0,0.1,0",
                "--target",
                "6DoF",
            ],
            "A:6DoF and B:6DoF",
        ),
        (["--target", f"{'A' * 81}:6DoF"], "a name of 81"),
        (["--target", "=A:6DoF"], "--target"),
        (["--orientation-noise", "0.01deg"], "--measured pose"),
        (["--measured", "pose", "--orientation-noise", "0.01"], "with its unit"),
        (["--box=-9,9,-9,9,-9,9"], "boxes"),
        (["--floor", "9"], "--floor"),
    ],
)
def test_a_wrong_option_is_refused_by_its_name_and_nothing_is_written(
    refusal, tmp_path, options, message
):
    assert message in refusal(*PLAN, "--folder", tmp_path / "cell", *options)
    assert list(tmp_path.iterdir()) == []


def test_three_reflectors_on_one_flange_are_three_targets_of_a_probe(plan):
    options = ["--measured", "pose", "--noise", "50um"]
    for target in ("A:6DoF=0.1,0,0", "B:6DoF=0.2,0,0", "C:6DoF=0.3,0,0", "6DoF"):
        options += ["--target", target]
    answer, document, sheet = plan(*options)
    assert "50 µm, 87.3 µrad" in answer and "Leica" in answer
    offsets = {name: target["offset_m"] for name, target in document["targets"].items()}
    assert offsets == {
        "A": [0.1, 0.0, 0.0],
        "B": [0.2, 0.0, 0.0],
        "C": [0.3, 0.0, 0.0],
        "6DoF": "unknown",
    }
    assert document["measured"] == "pose"
    assert document["noise"] == {
        "position_m": pytest.approx(50e-6),
        "orientation_rad": pytest.approx(np.radians(0.005)),
    }
    rows_of_target = sheet["target"].value_counts()
    assert set(rows_of_target) == {len(sheet) // 4}
    assert set(rows_of_target.index) == {"A", "B", "C", "6DoF"}


@pytest.mark.parametrize("name", ["kuka_nothing_missing", "a{b}"])
def test_a_folder_that_diagnose_would_refuse_is_refused_before_measuring(
    refusal, tmp_path, name
):
    folder = tmp_path / name
    message = refusal("plan", ROBOTS / "kuka.yaml", "--folder", folder)
    assert "allowed" in message and not folder.exists()


def test_the_sentence_says_whether_the_offset_of_the_tool_is_in_it(plan):
    answer, _, _ = plan()
    text = " ".join(answer.split())
    assert "of its base and of a constant offset at the end effector)" in text
    assert "It does not include the offset of the tool" in text


def test_a_stated_offset_of_the_tool_is_in_the_error(plan):
    text = " ".join(plan("--target", "6DoF=0,0,0.1")[0].split())
    assert "(after the best placement of its base): " in text
    assert "It includes the offset of the tool" in text


def test_plan_wants_as_many_poses_as_check_does(plan, elastocal, tmp_path):
    answer, _, sheet = plan("--target", "6DoF=0,0,0.1")
    (planned,) = re.findall(r"Measure about (\d+) poses", answer)
    positions = compute_positions(sheet)
    noise = 3e-5 * np.random.default_rng(1).standard_normal(positions.shape)
    x, y, z = (positions + noise).T
    filled = sheet.assign(done="x", x=x, y=y, z=z)
    filled.to_csv(tmp_path / "cell" / "measurements.csv", index=False)
    checked = elastocal("check", tmp_path / "cell")
    (needed,) = re.findall(r"Measure about (\d+) poses", checked.stdout)
    assert abs(int(planned) - int(needed)) <= 0.1 * int(needed)


def test_a_plan_with_enough_numbers_has_no_remark(plan):
    options = ("--force", 200, "--pull", "--base-known", "--measured", "pose")
    targets = ("--target", "6DoF=0,0,0", "--target", "4DoF=0,0,0")
    size = ("--poses", "30", "--candidates", "60")
    assert "poses are few" not in plan(*options, *targets, *size)[0]


@pytest.mark.parametrize("name", ["cell 7", "-cell", "größe", "a" * 81, "a<b"])
def test_a_folder_that_check_refuses_is_refused_before_the_planning(
    refusal, tmp_path, name
):
    folder = tmp_path / name
    refusal(*PLAN, "--folder", folder)
    assert not folder.exists()


PANDA = (
    "plan",
    ROBOTS / "panda.yaml",
    "--candidates",
    200,
    "--held-out",
    4,
)
SOCKETS = (
    "--measured",
    "point",
    "--place",
    "left=0.45,0.1,0.05",
    "--place",
    "right=0.5,-0.1,0.05",
    "--target",
    "ball:7DoF=0,0,-0.1",
)


@pytest.mark.drawn
def test_a_plan_of_sockets_is_a_sheet_to_fill_in_with_joint_angles(elastocal, tmp_path):
    folder = tmp_path / "cell"
    result = elastocal(*PANDA, "--poses", 32, *SOCKETS, "--folder", folder)
    assert result.exit_code == 0, result.exception
    assert "with the joint angles of each contact" in " ".join(result.stderr.split())
    assert {path.name for path in folder.iterdir()} == FILES | {"plan.csv"}
    document = yaml.safe_load((folder / "campaign.yaml").read_text())
    assert document["measured"] == "point"
    assert document["features"] == {"left": {}, "right": {}}
    assert document["targets"] == {"ball": {"point": "7DoF", "offset_m": "unknown"}}
    sheet = pd.read_csv(folder / "measurements.csv")
    # What was planned is only the way to the socket.
    assert sheet[[f"q{joint}" for joint in range(1, 8)]].isna().all(axis=None)
    assert len(sheet) == 36 and set(sheet["feature"]) == {"left", "right"}
    planned = pd.read_csv(folder / "plan.csv")
    filled = sheet.drop(columns="done").assign(
        **{name: planned[name] for name in planned if re.fullmatch(r"q\d", name)}
    )
    filled.to_csv(folder / "measurements.csv", index=False)
    checked = elastocal("check", folder)
    assert checked.exit_code == 0, checked.exception


def see_board(sheet, board_m):
    """Poses of a board in the camera on the flange of a Panda, columns by name."""
    commands = sheet[[f"q{joint}" for joint in range(1, 8)]].to_numpy()
    position, rotation = compute_nominal_poses(analysed("panda"), commands)
    inverse = Rotation.from_matrix(rotation).inv()
    numbers = np.hstack([inverse.apply(board_m - position), inverse.as_rotvec()])
    numbers += 1e-4 * np.random.default_rng(1).standard_normal(numbers.shape)
    return dict(zip(("x", "y", "z", "rx", "ry", "rz"), numbers.T, strict=True))


@pytest.mark.drawn
def test_a_plan_of_a_camera_is_a_sheet_for_poses_of_the_board(elastocal, tmp_path):
    folder = tmp_path / "cell"
    options = ("--measured", "board", "--place", "board=0.5,0,0.02", "--poses", 20)
    result = elastocal(*PANDA, *options, "--folder", folder)
    assert result.exit_code == 0, result.exception
    document = yaml.safe_load((folder / "campaign.yaml").read_text())
    assert document["camera"] == "on_robot" and document["frame"] == "unknown"
    # Its noise is estimated, because declared noise is taken for alike in all poses.
    assert "noise" not in document
    sheet = pd.read_csv(folder / "measurements.csv")
    assert "feature" not in sheet and sheet[["x", "rz"]].isna().all(axis=None)
    assert not sheet["q1"].isna().any()
    next_step = " ".join(result.output.partition("next: ")[2].split())
    assert "elastocal import board boards.csv --joints" in next_step
    # A board that is seen where the robot puts it has a campaign that can be checked.
    filled = sheet.assign(**see_board(sheet, np.array([0.5, 0.0, 0.02])), done="x")
    filled.to_csv(folder / "measurements.csv", index=False)
    checked = elastocal("check", folder)
    assert checked.exit_code == 0, checked.exception


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--measured", "relative"], "'relative', which has no plans"),
        (["--measured", "points"], "point"),
        (["--measured", "point"], "no place"),
        (["--place", "left=0.4,0,0"], "--place"),
        (["--measured", "point", "--place", "left=0.4,0"], "left=x,y,z,nx,ny,nz"),
        (["--measured", "point", "--place", "left=0.4,0,0,0,0,0"], "a direction"),
        ([*SOCKETS, "--limit", "tilt=3"], "tilt_deg=60"),
        ([*SOCKETS, "--limit", "tilt_deg=-3"], "above 0"),
        ([*SOCKETS, "--base-known"], "--base-known"),
        ([*SOCKETS, "--force", "10"], "--force"),
        ([*SOCKETS, "--tracker", "1,2,3"], "--tracker"),
        ([*SOCKETS, "--target", "A:2DoF"], "2 targets"),
        ([*SOCKETS, "--place", "far=9,0,0"], "the arm does not reach it"),
        (
            ["--measured", "board", "--place", "a=1,0,0", "--place", "b=0,1,0"],
            "2 places",
        ),
    ],
)
def test_a_wrong_place_is_refused_by_its_option(refusal, tmp_path, options, message):
    folder = tmp_path / "cell"
    found = " ".join(
        refusal(*PANDA, "--poses", 32, *options, "--folder", folder).split()
    )
    assert message in found
    assert list(tmp_path.iterdir()) == []
