import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import yaml
from made_urdf import Pinocchio, write_linkage
from scipy.spatial.transform import Rotation

import elastocal as ec
from elastocal.evaluators import elastocal_model
from elastocal.interface.diagnoses import PROPOSED_POSES, SEED
from elastocal.mechanics.kinematics import compute_poses

TOP = Path(__file__).resolve().parents[2]
VERDICT = "reports/loop/ur5_every_seventh/verdict.json"


def test_a_wrong_zero_is_named_and_its_size_found(result):
    (effect,) = result.effects
    (parameter,) = effect.parameters
    assert effect.name == "joint_offset"
    assert effect.joints == (2,)
    assert abs(parameter.value - 2e-3) < 3.0 * parameter.std_error


def test_errors_fall_to_the_noise(result):
    floor_m = result.verdict.heldout.noise_floor_rms_m
    assert result.before.rms_m > 20 * floor_m
    assert result.after.rms_m < 1.2 * floor_m


def test_seed_and_proposed_poses_are_those_of_the_workflow():
    config = yaml.safe_load((TOP / "config.yaml").read_text("utf-8"))
    assert config["seed"] == SEED
    assert config["loop"]["proposed_states"] == PROPOSED_POSES


def test_result_prints_verdict_and_errors_in_a_few_lines(result):
    first, second, *_ = str(result).splitlines()
    assert "zero offset of joint 2" in first
    assert f"{1e3 * result.after.rms_m:.3f} mm" in second


def test_residuals_have_a_row_for_each_measurement(result, campaign):
    assert len(result.residuals["row"]) == len(campaign)
    assert result.residuals["held_out"].any()


def test_residuals_are_without_gross_errors_as_those_of_the_report(nominal, measured):
    wrong = measured.copy()
    wrong.loc[20, "x"] += 0.05
    target = {"reflector": {"point": "tool", "offset_m": [0, 0, 0], "offset_std_m": 0}}
    settings = {"frame": "base", "declared": [], "remainder": "none"}
    campaign = ec.Campaign.from_table(nominal, wrong, targets=target, **settings)
    result = ec.diagnose(campaign)
    assert len(result.verdict.gross_errors) == 1
    assert len(result.residuals["row"]) == len(campaign) - 1


def test_report_is_written_and_its_facts_name_the_effect(
    result, tmp_path, blank_figures
):
    result.report(tmp_path / "report.pdf")
    assert (tmp_path / "report.pdf").read_bytes().startswith(b"%PDF")
    assert "zero offset of joint 2" in result.facts["sentences"][0]


def test_progress_is_reported_in_lines(campaign):
    lines = []
    ec.diagnose(campaign, report_progress=lines.append)
    assert lines
    assert all("\n" not in line for line in lines)


def test_the_order_of_rows_does_not_change_the_diagnosis(nominal, measured):
    """Nothing has moved during these measurements, so that only rounding differs."""
    target = {"reflector": {"point": "tool", "offset_m": [0, 0, 0], "offset_std_m": 0}}
    settings = {"frame": "base", "declared": [], "targets": target}
    plain = measured[[*REPORTED, *"xyz"]]
    shuffled = plain.sample(frac=1.0, random_state=6)
    results = [
        ec.diagnose(ec.Campaign.from_table(nominal, table, **settings))
        for table in (plain, shuffled)
    ]
    first, second = (
        result.errors.set_index("step").select_dtypes("number") for result in results
    )
    pd.testing.assert_frame_equal(first, second, rtol=1e-6)
    parts = [result.effects for result in results]
    assert [effect.name for effect in parts[0]] == [effect.name for effect in parts[1]]
    for first, second in zip(*parts, strict=True):
        assert first.probability == pytest.approx(second.probability, rel=1e-6)
        for one, other in zip(first.parameters, second.parameters, strict=True):
            assert one.value == pytest.approx(other.value, rel=1e-6)


@pytest.mark.slow
def test_a_folder_gives_the_verdict_of_the_command(tmp_path):
    """The same campaign by `elastocal diagnose` and in memory."""
    subprocess.run(
        [
            sys.executable,
            "-m",
            "snakemake",
            "-j1",
            "-d",
            str(TOP),
            "reports/loop/ur5_every_seventh/verdict.json",
        ],
        check=True,
        cwd=TOP,
    )
    campaign = ec.read_campaign(
        TOP / "data/campaigns/ur5_every_seventh", TOP / "config/robots"
    )
    result = ec.diagnose(campaign)
    verdict = ec.read_verdict(TOP / VERDICT)
    (effect,) = result.effects
    (stored,) = verdict.missing_effects
    assert effect.members == stored.members
    np.testing.assert_allclose(effect.probability, stored.probability, atol=1e-3)
    # The workflow restores the fits from files and lets them converge once more, which
    # moves errors far above the noise by a thousandth.
    for name in ("before", "after", "delivered"):
        np.testing.assert_allclose(
            getattr(result.verdict.heldout, name).rms_m,
            getattr(verdict.heldout, name).rms_m,
            rtol=1e-3,
        )
    np.testing.assert_allclose(
        result.verdict.accuracy.rms_m, verdict.accuracy.rms_m, rtol=1e-2
    )


NOISE_M = 2e-5
POSE = ["x", "y", "z", "rx", "ry", "rz"]
REPORTED = [f"q{number}" for number in range(1, 7)]
# What the URDF does not know of the joint that follows another one.
WRONG_SHIFT_M = (0.1, 0.0, 8e-4)
WRONG_OFFSET_RAD = 2e-3


@pytest.fixture(scope="session")
def linkage(tmp_path_factory):
    """A robot by its URDF with a joint that follows, the same robot as it is built, by
    pinocchio, and its diagnosis."""
    folder = tmp_path_factory.mktemp("linkage")
    robot = ec.read_robot(write_linkage(folder), base="base", tip="tool")
    (folder / "built").mkdir()
    path = write_linkage(
        folder / "built", shift=WRONG_SHIFT_M, offset=0.1 + WRONG_OFFSET_RAD
    )
    built = Pinocchio(path, mimic=True)
    stream = np.random.default_rng(8)
    commands = stream.uniform(-1.2, 1.2, (45, robot.commands))
    positions = locate_tool(built, robot, commands)
    positions += NOISE_M * stream.standard_normal(positions.shape)
    target = {"reflector": {"point": "tool", "offset_m": [0, 0, 0], "offset_std_m": 0}}
    campaign = ec.Campaign(
        robot,
        joint_angles=commands,
        positions=positions,
        frame="base",
        targets=target,
        noise={"position_m": NOISE_M},
        remainder="none",
    )
    return robot, built, ec.diagnose(campaign)


def locate_tool(built, robot, commands):
    """Positions of the built robot's tool at commands (N, 6)."""
    return np.array(
        [
            built.pose(
                "base", "tool", dict(zip(robot.command_names, row, strict=True))
            )[0]
            for row in commands
        ]
    )


@pytest.mark.slow
def test_errors_of_a_joint_that_follows_are_found(linkage):
    """Its zero, and its place in the chain, with six reported angles for seven
    joints."""
    _, _, result = linkage
    heldout = result.verdict.heldout
    assert heldout.before.rms_m > 1e-3
    assert heldout.after.rms_m < 1.5 * np.sqrt(3.0) * NOISE_M


def make_path(robot):
    """Commands (20, 6) away from the wrist's singular posture, and the nominal robot's
    poses there with the commands as postures."""
    commands = np.random.default_rng(9).uniform(-0.9, 0.9, (20, robot.commands))
    commands[:, 4] = 0.3 + 0.8 * np.abs(commands[:, 4])
    position, rotation = compute_poses(
        robot.chain, robot.model_angles(commands), robot.chain.end_effector
    )
    vectors = Rotation.from_matrix(rotation).as_rotvec()
    columns = np.hstack([position, vectors, commands])
    return commands, pd.DataFrame(columns, columns=[*POSE, *REPORTED])


@pytest.mark.slow
def test_a_robot_with_a_joint_that_follows_is_corrected_by_its_commands(linkage):
    """Poses of the nominal robot are reached by the built one, which pinocchio moves."""
    robot, built, result = linkage
    commands, wanted = make_path(robot)
    table = result.robot.correct(wanted, allow_large_steps=True).table
    assert not {"q7", "q7_uncorrected"} & {*table}
    position = wanted[[*"xyz"]].to_numpy()
    before = np.linalg.norm(locate_tool(built, robot, commands) - position, axis=1)
    corrected = table[REPORTED].to_numpy()
    after = np.linalg.norm(locate_tool(built, robot, corrected) - position, axis=1)
    assert before.mean() > 1e-3 and after.max() < 1e-4


@pytest.mark.slow
def test_a_certificate_of_a_robot_with_a_joint_that_follows_is_decided(linkage):
    _, _, result = linkage
    assert result.robot.certify(tolerance_m=1e-2).decision == "pass"


@pytest.mark.slow
def test_files_of_a_robot_with_a_joint_that_follows_have_its_poses(linkage, tmp_path):
    """The written URDF by pinocchio, and the model file by the evaluator."""
    robot, _, result = linkage
    commands, _ = make_path(robot)
    by_model, _ = result.robot.predict(commands)
    result.robot.to_urdf(tmp_path / "made.urdf", write_linkage(tmp_path))
    written = Pinocchio(tmp_path / "made.urdf", mimic=True)
    by_urdf = locate_tool(written, robot, commands)
    np.testing.assert_allclose(by_urdf, by_model, atol=1e-9)
    result.robot.save(tmp_path / "arm.json")
    evaluator = elastocal_model.load_model(tmp_path / "arm.json")
    by_evaluator, _ = evaluator.predict(commands)
    np.testing.assert_allclose(by_evaluator, by_model, atol=1e-12)
