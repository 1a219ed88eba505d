"""`elastocal export`: the calibrated robot as a robot file and as the user's URDF."""

import json
import re
from pathlib import Path

import jsonschema
import numpy as np
import pandas as pd
import pytest
from analysed_robots import ROBOTS, analysed
from made_urdf import joint, link
from made_urdf import robot as make_urdf

from elastocal.application.accuracy import (
    predict_campaign_accuracy,
    select_campaign_commands,
)
from elastocal.application.calibrated import predict_poses
from elastocal.campaigns.reading import read_robot
from elastocal.exchange.urdf import robot_from_urdf
from elastocal.loop.calibrated_files import load_diagnosed
from elastocal.mechanics.kinematics import compute_poses

ANGLES = 0.5 * np.linspace(-1, 1, 6)[None]


def join_lines(text):
    return " ".join(text.split())


def test_the_robot_file_holds_the_identified_parameters(
    in_checkout, elastocal, tmp_path
):
    result = elastocal("export", "made", "--output", tmp_path / "out")
    assert result.exit_code == 0, result.output
    robot = read_robot(tmp_path / "out" / "robot.yaml")
    nominal = analysed("kuka")
    offset = robot.reported_offset[2] - nominal.reported_offset[2]
    assert abs(offset) == pytest.approx(3e-4, rel=0.2)
    assert (robot.compliance != nominal.compliance).any()
    assert not (tmp_path / "out" / "robot.urdf").exists()
    assert "no file holds" not in result.stderr


def test_an_export_says_how_much_is_lost_without_the_regression(
    elastocal, copied_regressed_checkout, tmp_path
):
    verdict = json.loads(Path("reports/loop/smooth/verdict.json").read_text())
    result = elastocal("export", "smooth", "--output", tmp_path / "out")
    answer = join_lines(result.stderr)
    loss = re.search(
        r"no file holds the Gaussian process .*?up to (\S+) mm at the measured poses"
        r" \((\S+) mm RMS",
        answer,
    )
    assert loss and 0.1 < float(loss[2]) < float(loss[1]) < 1.0
    by_physics_m = verdict["physics"]["rms_m"]
    assert f": {1e3 * by_physics_m:.3f} mm (" in answer


def urdf_of(robot):
    """Write a robot as URDF, with a joint for each of its transforms."""
    end = robot.chain.end_effector
    elements = [link("base")]
    parent = "base"
    for number, transform in enumerate(robot.chain.transforms[: end.after], 1):
        child = end.name if number == end.after else f"l{number}"
        axis = np.eye(3)[transform.axis]
        kind = "revolute"
        origin = {}
        if transform.coordinate is None:
            kind = "fixed"
            key = "xyz" if transform.kind == "T" else "rpy"
            origin[key] = transform.constant * axis
        axis = (transform.sign or 1) * axis
        elements.append(link(child))
        elements.append(joint(f"j{number}", parent, child, kind, axis=axis, **origin))
        parent = child
    return make_urdf(*elements)


@pytest.fixture
def exported(in_checkout, elastocal, tmp_path):
    """Export with a URDF of the user that has a comment; result and folder."""
    urdf = tmp_path / "mine.urdf"
    text = urdf_of(analysed("kuka")).replace("<link ", "<!-- mine --><link ", 1)
    urdf.write_text(text)
    result = elastocal("export", "made", "--urdf", urdf, "--output", tmp_path / "out")
    assert result.exit_code == 0, result.output
    return result, tmp_path / "out"


def test_only_the_joint_origins_of_the_users_urdf_are_changed(exported, tmp_path):
    result, folder = exported
    answer = join_lines(result.stderr)
    assert re.search(r"robot\.urdf: \d+ joint origins? changed, nothing else", answer)
    assert "cannot hold" not in answer
    text = (folder / "robot.urdf").read_text()
    assert text.count('effort="1"') == 6 and "<!-- mine -->" in text
    assert text != (tmp_path / "mine.urdf").read_text()


def test_the_error_of_the_urdf_itself_is_stated(exported, in_checkout):
    """It holds no springs, so that it errs by far more than the corrected robot."""
    result, folder = exported
    answer = join_lines(result.stderr)
    stated = re.search(r"robot\.urdf alone: (\S+) mm RMS .* errs by (\S+) mm", answer)
    calibrated = load_diagnosed("made", ROBOTS, in_checkout).calibrated
    commands, wrench = select_campaign_commands(calibrated)
    reached, _ = predict_poses(calibrated, commands, wrench)
    end = calibrated.robot.chain.end_effector
    chain = robot_from_urdf(folder / "robot.urdf", "base", end.name).robot.chain
    position, _ = compute_poses(
        chain, calibrated.robot.model_angles(commands), chain.end_effector
    )
    rms_mm = 1e3 * np.sqrt(((position - reached) ** 2).sum(axis=1).mean())
    accuracy_mm = 1e3 * predict_campaign_accuracy(calibrated).rms_m
    assert float(stated[1]) == pytest.approx(np.hypot(rms_mm, accuracy_mm), rel=0.01)
    assert accuracy_mm < float(stated[1]) <= float(stated[2])


def test_the_urdf_has_the_poses_of_the_robot_file(exported):
    _, folder = exported
    robot = read_robot(folder / "robot.yaml")
    end = robot.chain.end_effector
    from_urdf = robot_from_urdf(folder / "robot.urdf", "base", end.name).robot
    wanted, _ = compute_poses(robot.chain, robot.model_angles(ANGLES), end)
    position, _ = compute_poses(from_urdf.chain, ANGLES, from_urdf.chain.end_effector)
    np.testing.assert_allclose(position, wanted, atol=1e-9)


@pytest.mark.parametrize(
    ("text", "message"),
    [(urdf_of(analysed("gp180")), "imported"), ("<robot/>", "no <link>")],
)
def test_the_urdf_of_another_robot_is_refused(
    in_checkout, refusal, tmp_path, text, message
):
    urdf = tmp_path / "other.urdf"
    urdf.write_text(text)
    arguments = ("export", "made", "--urdf", urdf, "--output", tmp_path / "out")
    assert message in refusal(*arguments)
    assert not (tmp_path / "out").exists()


def test_the_users_urdf_is_not_replaced(exported, refusal):
    _, folder = exported
    urdf = folder / "robot.urdf"
    text = urdf.read_text()
    message = refusal("export", "made", "--urdf", urdf, "--output", folder)
    assert "a file that this command reads" in message
    assert urdf.read_text() == text


def test_an_export_into_the_campaigns_folder_keeps_its_files(
    copied_checkout, elastocal, refusal
):
    """robot.yaml, and a robot.urdf that lies there although no URDF is exported."""
    robot = Path("made/robot.yaml")
    urdf = Path("made/robot.urdf")
    urdf.write_text("<robot/>")
    before = robot.read_bytes() if robot.exists() else None
    message = refusal("export", "made", "--output", "made")
    assert "--force" in message
    assert urdf.read_text() == "<robot/>"
    assert (robot.read_bytes() if robot.exists() else None) == before


def test_an_export_may_be_repeated_but_not_over_an_edited_file(
    copied_checkout, elastocal, refusal
):
    arguments = ("export", "made", "--output", "out")
    assert elastocal(*arguments).exit_code == 0
    assert elastocal(*arguments).exit_code == 0
    robot = Path("out/robot.yaml")
    robot.write_text(robot.read_text() + "# mine\n")
    assert "changed since" in refusal(*arguments)
    assert elastocal(*arguments, "--force").exit_code == 0


def test_an_export_into_a_folder_that_the_user_has_linked_is_written_there(
    copied_checkout, elastocal, tmp_path
):
    """A link that the user names is no link that somebody else has placed."""
    (tmp_path / "elsewhere").mkdir()
    Path("out").symlink_to(tmp_path / "elsewhere")
    result = elastocal("export", "made", "--output", Path("out").absolute())
    assert result.exit_code == 0, result.output
    assert (tmp_path / "elsewhere" / "robot.yaml").is_file()


def test_further_formats_are_written_and_the_model_file_corrects_alike(
    in_checkout, elastocal, tmp_path, path, angles
):
    out = tmp_path / "out"
    formats = [f"--format={name}" for name in ("model", "evaluators", "mjcf")]
    result = elastocal("export", "made", "--output", out, *formats)
    assert result.exit_code == 0, result.output
    written = {entry.name for entry in out.iterdir()}
    assert written == {
        "robot.yaml",
        "robot.elastocal.json",
        "elastocal_model.py",
        "elastocal_model.hpp",
        "model.schema.json",
        "robot.xml",
    }
    schema = json.loads((out / "model.schema.json").read_text("utf-8"))
    model = out / "robot.elastocal.json"
    jsonschema.validate(json.loads(model.read_text("utf-8")), schema)
    tables = []
    for source in ("made", model):
        targets = tmp_path / "targets.csv"
        result = elastocal("correct", source, path, "--output", targets, "--force")
        assert result.exit_code == 0, result.output
        tables.append(pd.read_csv(targets))
    pd.testing.assert_frame_equal(*tables, rtol=1e-9)


def test_an_unknown_format_is_refused_before_anything_is_written(
    in_checkout, refusal, tmp_path
):
    out = tmp_path / "out"
    line = refusal("export", "made", "--output", out, "--format", "sdf")
    assert "'sdf'" in line and "model, evaluators, mjcf" in line
    assert not out.exists()


def test_a_kinematics_file_of_another_robot_leaves_no_export(
    in_checkout, refusal, tmp_path
):
    out = tmp_path / "out"
    zero = "{x: 0, y: 0, z: 0, roll: 0, pitch: 0, yaw: 0}"
    links = ("shoulder", "upper_arm", "forearm", "wrist_1", "wrist_2", "wrist_3")
    original = tmp_path / "calibration.yaml"
    lines = [f"  {link}: {zero}" for link in links]
    original.write_text("\n".join(["kinematics:", *lines]), "utf-8")
    line = refusal("export", "made", "--output", out, "--kinematics", original)
    assert "another robot" in line
    assert not out.exists()
