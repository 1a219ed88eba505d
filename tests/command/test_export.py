"""The calibrated robot as files that are read again."""

import json
import re

import numpy as np
import pandas as pd
import pytest
from analysed_robots import analysed
from made_calibrated import made_calibrated
from made_urdf import joint, link, written
from made_urdf import robot as made

from elastocal.application.exported import fold_effects
from elastocal.campaigns.reading import read_robot
from elastocal.command.export import _drop_in
from elastocal.exchange.dh import robot_from_dh
from elastocal.exchange.urdf import robot_from_urdf
from elastocal.exchange.urdf_writing import write_calibrated_origins
from elastocal.mechanics.kinematics import poses


def test_robot_file_urdf_and_sidecar_hold_what_was_found(in_checkout, elastocal, tmp_path):
    result = elastocal("export", "made", "--output", tmp_path / "out", "--date", "2026-11-23")
    assert result.exit_code == 0, result.output
    robot = read_robot(tmp_path / "out" / "robot.yaml")
    nominal = analysed("kuka")
    assert abs(robot.reported_offset[2] - nominal.reported_offset[2]) == pytest.approx(3e-4, rel=0.2)
    assert (robot.compliance != nominal.compliance).any()
    assert not (tmp_path / "out" / "robot.urdf").exists()
    by_table = robot_from_dh(tmp_path / "out" / "dh.csv").robot
    angles = 0.5 * np.linspace(-1, 1, 6)[None]
    mine = poses(robot.chain, robot.model_angles(angles), robot.chain.end_effector)
    theirs = poses(by_table.chain, by_table.model_angles(angles), by_table.chain.end_effector)
    for one, other in zip(mine, theirs, strict=True):
        np.testing.assert_allclose(other, one, atol=1e-9)
    deltas = pd.read_csv(tmp_path / "out" / "dh_deltas.csv").set_index("row")
    assert abs(deltas.loc["q3", "delta_theta_deg"]) == pytest.approx(np.degrees(3e-4), rel=0.2)
    document = json.loads((tmp_path / "out" / "effects.json").read_text())
    assert all(spring["std_error"] != 0 for spring in document["joint_compliance"])
    assert document["effects"] == [] and document["date"] == "2026-11-23" and len(document["joint_compliance"]) == 6


def test_a_regression_that_no_file_can_hold_is_said_with_its_size(elastocal, regressed_checkout, monkeypatch, tmp_path):
    monkeypatch.chdir(regressed_checkout)
    result = elastocal("export", "smooth", "--output", tmp_path / "out")
    told = " ".join(result.stderr.split())
    lost = re.search(r"no file holds the Gaussian process .*?up to (\S+) mm at the measured poses \((\S+) mm RMS", told)
    assert lost and 0.1 < float(lost[2]) < float(lost[1]) < 1.0
    verdict = json.loads((regressed_checkout / "reports/loop/smooth/verdict.json").read_text())
    stated = json.loads((tmp_path / "out" / "effects.json").read_text())["accuracy"]
    assert stated["rms_m"] == pytest.approx(verdict["physics"]["accuracy"]["rms_m"], rel=1e-3)


def urdf_of(arm):
    """A robot as URDF, a joint for each of its transforms."""
    parts, above = [link("base")], "base"
    for number, each in enumerate(arm.chain.transforms[: arm.chain.end_effector.after], 1):
        name = arm.chain.end_effector.name if number == arm.chain.end_effector.after else f"l{number}"
        axis = np.eye(3)[each.axis]
        place = {"xyz" if each.kind == "T" else "rpy": each.constant * axis} if each.coordinate is None else {}
        kind = "fixed" if place else "revolute"
        parts += [link(name), joint(f"j{number}", above, name, kind, axis=(each.sign or 1) * axis, **place)]
        above = name
    return made(*parts)


def test_the_users_urdf_comes_back_with_other_joint_origins_and_another_robots_is_refused(
    in_checkout, elastocal, refusal, tmp_path
):
    mine, output = tmp_path / "mine.urdf", tmp_path / "out"
    mine.write_text(urdf_of(analysed("kuka")).replace("<link ", "<!-- mine --><link ", 1))
    result = elastocal("export", "made", "--urdf", mine, "--output", output)
    assert result.exit_code == 0, result.output
    told = " ".join(result.stderr.split())
    assert re.search(r"robot\.urdf: \d+ joint origins? changed, nothing else", told) and "cannot hold" not in told
    text = (output / "robot.urdf").read_text()
    assert text.count('effort="1"') == 6 and "<!-- mine -->" in text and text != mine.read_text()
    robot = read_robot(output / "robot.yaml")
    back = robot_from_urdf(output / "robot.urdf", "base", robot.chain.end_effector.name).robot
    angles = 0.5 * np.linspace(-1, 1, 6)[None]
    wanted = poses(robot.chain, robot.model_angles(angles), robot.chain.end_effector)[0]
    np.testing.assert_allclose(poses(back.chain, angles, back.chain.end_effector)[0], wanted, atol=1e-9)
    for wrong, where in ((urdf_of(analysed("gp180")), "imported"), ("<robot/>", "no <link>")):
        other = tmp_path / "other.urdf"
        other.write_text(wrong)
        assert where in refusal("export", "made", "--urdf", other, "--output", tmp_path / "none")
    assert "would be replaced" in refusal("export", "made", "--urdf", output / "robot.urdf", "--output", output)
    assert not (tmp_path / "none").exists() and (output / "robot.urdf").read_text() == text


def test_what_a_urdf_has_no_place_for_is_stated_in_millimetres(tmp_path):
    """No fixed joint stands behind the last one, whose link's own error turns with it; and ratios are no joint origins."""
    path = written(tmp_path, link("a"), link("b"), link("c"), joint("one", "a", "b"), joint("two", "b", "c", xyz=(0.5, 0, 0)))
    nominal = robot_from_urdf(path, "a", "c").robot
    angles = np.array([[0.4, -0.3], [1.0, 0.2]])

    def lines(*keys):
        robot = fold_effects(made_calibrated(nominal, *keys, identified=False)).robot
        drop_in = write_calibrated_origins(path, nominal, robot)
        output = tmp_path / "robot.urdf"
        output.write_bytes(drop_in.content)
        return _drop_in(drop_in, output, nominal, robot, angles)

    assert len(lines("joint_offset@1", "joint_offset@2", "link_geometry@1")) == 1
    for key in ("link_geometry@2", "transmission_ratio@1"):
        assert re.search(r"cannot hold .*: up to 0\.[0-9]*[1-9][0-9]* mm", lines("link_geometry@1", key)[1])
