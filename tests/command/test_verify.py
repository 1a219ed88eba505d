"""`elastocal verify`: a corrected robot against its prediction, and another round of the
loop with what was measured."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import yaml
from analysed_robots import ROBOTS, analysed
from scipy.spatial.transform import Rotation

from elastocal.application.calibrated import compute_nominal_poses, predict_poses
from elastocal.campaigns.campaign_folder import read_campaign_folder
from elastocal.campaigns.reading import read_campaign
from elastocal.command import campaign as campaign_command
from elastocal.loop import calibrated_files
from elastocal.loop.calibrated_files import load_diagnosed
from elastocal.loop.diagnosis_tables import restore_step_model

REPORT = Path("reports/loop/made")
JOINTS = [f"q{joint}" for joint in range(1, 7)]
COUNT = 24


@pytest.fixture
def loop(elastocal, copied_checkout, tmp_path):
    """Corrects a path of 24 spread targets by the campaign ``made``, and measures the
    robot that its diagnosis believes in, with an additional error."""
    return Loop(elastocal, copied_checkout, tmp_path)


class Loop:
    def __init__(self, elastocal, top, tmp_path):
        self.run = elastocal
        self.top = top
        self.measured = tmp_path / "measured.csv"
        self.targets = tmp_path / "targets.csv"
        self.campaign = load_diagnosed("made", ROBOTS, top)
        robot = analysed("kuka")
        low, high = robot.joint_limits.T
        shares = np.random.default_rng(5).uniform(0.35, 0.65, (COUNT, 6))
        angles = low + shares * (high - low) + np.array([0, 0.2, 0.1, 0.3, 0.7, 0])
        self.position, self.rotation = compute_nominal_poses(robot, angles)
        vectors = Rotation.from_matrix(self.rotation).as_rotvec()
        columns = ["x", "y", "z", "rx", "ry", "rz", *JOINTS]
        table = np.column_stack([self.position, vectors, angles])
        pd.DataFrame(table, columns=columns).to_csv(tmp_path / "path.csv", index=False)
        result = elastocal(
            "correct",
            "made",
            tmp_path / "path.csv",
            "--output",
            self.targets,
            "--allow-large-steps",
        )
        assert result.exit_code == 0, result.output

    def move(self, error_m=0.0):
        """Return measured positions: those that the diagnosis predicts, with noise of the
        tracker and an error that grows along the targets."""
        commands = pd.read_csv(self.targets)[JOINTS].to_numpy()
        position, _ = predict_poses(self.campaign.calibrated, commands)
        noise_m = self.campaign.calibrated.noise.position_m
        noise = np.random.default_rng(1).normal(0.0, noise_m, position.shape)
        error = np.zeros_like(position)
        error[:, 2] = error_m * np.linspace(-1.7, 1.7, COUNT)
        return position + noise + error

    def write(self, position, **columns):
        table = pd.DataFrame(position, columns=["x", "y", "z"]).assign(**columns)
        table.to_csv(self.measured, index=False)

    def verify(self, *options):
        result = self.run("verify", "made", self.measured, *options)
        document = REPORT / "verification.json"
        return result, json.loads(document.read_text()) if document.exists() else None


@pytest.mark.drawn
def test_a_robot_as_predicted_passes_as_measured_and_nothing_remains(loop):
    loop.write(loop.move())
    result, document = loop.verify("--tolerance", "0.5mm")
    assert result.exit_code == 0, result.output
    assert document["prediction"]["held"] and not document["remaining"]["remains"]
    assert document["certificate"]["measured"]["decision"] == "pass"
    assert document["certificate"]["predicted"]["decision"] == "pass"
    assert "pass, as measured" in result.stderr and "held" in result.stderr
    table = pd.read_csv(REPORT / "verification.csv")
    assert len(table) == COUNT
    rms_m = np.sqrt((table["measured_error_m"] ** 2).mean())
    assert rms_m == pytest.approx(document["measured_rms_m"])
    assert document["before_rms_m"] > 3 * document["measured_rms_m"]
    for name in ("verification.pdf", "verification.png"):
        assert (REPORT / name).stat().st_size > 1000
    assert (REPORT / "verification.pdf").read_bytes().startswith(b"%PDF")


def test_a_robot_that_errs_more_than_predicted_fails_and_goes_round_again(loop):
    loop.write(loop.move(error_m=1e-3))
    result, document = loop.verify("--tolerance", "0.5mm")
    assert result.exit_code == 1
    assert not document["prediction"]["held"] and document["remaining"]["remains"]
    assert document["certificate"]["measured"]["decision"] == "fail"
    assert document["certificate"]["predicted"]["decision"] == "pass"
    assert document["remaining"]["rms_m"] == pytest.approx(1e-3, rel=0.2)
    assert f"elastocal diagnose made --with {loop.measured}" in result.stderr


def test_a_reflector_sits_where_the_diagnosis_has_estimated_it(loop, monkeypatch):
    """A declared offset is a caliper's; that it is wrong by 0.4 mm is no error of the
    robot if the campaign has found it."""
    offset_m = np.array([4e-4, -3e-4, 2e-4])

    def restore_with_offset(case, step):
        model, estimate = restore_step_model(case, step)
        offsets = estimate.target_offset.copy()
        offsets[[target.point == "6DoF" for target in case.campaign.targets]] = offset_m
        return model, replace(estimate, target_offset=offsets)

    loop.write(loop.move() + loop.rotation @ offset_m)
    _, document = loop.verify()
    assert not document["prediction"]["held"]
    monkeypatch.setattr(calibrated_files, "restore_step_model", restore_with_offset)
    _, document = loop.verify()
    assert document["prediction"]["held"]


def test_the_tolerance_of_the_last_certificate_is_taken(loop):
    loop.write(loop.move())
    loop.run("certificate", "made", "--tolerance", "0.4mm")
    _, document = loop.verify()
    assert document["certificate"]["measured"]["tolerance_m"] == 4e-4


def test_millimetres_other_orders_and_repeats_give_the_same_errors(loop):
    position = loop.move()
    loop.write(position)
    _, document = loop.verify()
    order = np.random.default_rng(2).permutation(np.repeat(np.arange(COUNT), 2))
    table = pd.DataFrame(1e3 * position[order], columns=["X [mm]", "Y [mm]", "Z [mm]"])
    table.assign(pose=order + 1).to_csv(loop.measured, index=False, sep=";")
    _, again = loop.verify()
    assert again["measured_rms_m"] == pytest.approx(document["measured_rms_m"])
    assert again["measurements"] == 2 * COUNT


def test_measurements_of_no_target_are_refused(loop, refusal):
    position = loop.move()
    loop.write(position[:-1])
    assert "no column 'pose'" in refusal("verify", "made", loop.measured)
    loop.write(position, pose=np.arange(COUNT))
    assert "1 to 24" in refusal("verify", "made", loop.measured)
    loop.write(position, **dict.fromkeys(JOINTS, 0.0))
    assert "joint angle of this target" in refusal("verify", "made", loop.measured)
    loop.write(1e3 * position)
    assert "metres" in refusal("verify", "made", loop.measured)
    loop.targets.unlink()
    assert "--targets" in refusal("verify", "made", loop.measured)


def test_a_file_that_verify_did_not_write_stays(loop, refusal):
    loop.write(loop.move())
    (REPORT / "verification.csv").write_text("mine\n")
    assert "--force" in refusal("verify", "made", loop.measured)
    assert (REPORT / "verification.csv").read_text() == "mine\n"


def test_a_further_round_has_both_sessions_and_leaves_the_campaign_alone(
    loop, refusal, monkeypatch
):
    diagnosed = []

    class NoSnakemake:
        """Stands in for the process of Snakemake."""

        stdout = ()
        returncode = 0

        def __init__(self, arguments, **_):
            diagnosed.append(arguments[-1])

        def __enter__(self):
            return self

        def __exit__(self, *_):
            return False

    monkeypatch.setattr(campaign_command.subprocess, "Popen", NoSnakemake)
    shutil.copy(ROBOTS / "kuka.yaml", "made/arm.yaml")
    document = yaml.safe_load(Path("made/campaign.yaml").read_text())
    document |= {"robot": "arm.yaml", "holdout": {"poses": [1, 3, 5]}}
    Path("made/campaign.yaml").write_text(yaml.safe_dump(document))
    before = read_campaign_folder("made", ROBOTS)
    digests = before.digests
    position = loop.move(error_m=1e-3)
    loop.write(position, **dict.fromkeys(("rx", "ry", "rz"), 0.1))
    result = loop.run("diagnose", "made", "--with", loop.measured)
    assert result.exit_code == 0, result.output
    assert diagnosed[0].endswith("made_round2")
    assert read_campaign_folder("made", ROBOTS).digests == digests
    joined = read_campaign(read_campaign_folder("made_round2", ROBOTS))
    first = read_campaign(before).measurements
    both = joined.measurements
    further = both.select(both.session == first.session.max() + 1)
    assert joined.name == "made_round2" and len(both) == len(first) + COUNT
    np.testing.assert_array_equal(both.position[: len(first)], first.position)
    np.testing.assert_array_equal(further.position, position)
    commands = pd.read_csv(loop.targets)[JOINTS].to_numpy()
    robot = joined.robot
    np.testing.assert_allclose(further.joint_angles, robot.model_angles(commands))
    assert joined.holdout == {"poses": [[0, 1], [0, 3], [0, 5]]}
    # A second run replaces its own files, and no changed ones.
    assert loop.run("diagnose", "made", "--with", loop.measured).exit_code == 0
    Path("made_round2/measurements.csv").write_text("changed\n")
    assert "--force" in refusal("diagnose", "made", "--with", loop.measured)
