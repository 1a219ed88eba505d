"""The simulated robot that stands in for a real one: its readings in a measurement
sheet, and its errors at commanded poses."""

import numpy as np
import pandas as pd
import pytest
from analysed_robots import ROBOTS, analysed
from scipy.spatial.transform import Rotation

from elastocal.errors import InputError
from elastocal.exchange.target_path import read_target_path
from elastocal.mechanics.kinematics import compute_poses
from elastocal_proof.blind.rehearsal import (
    build_hidden_robot,
    fill_sheet,
    measure_errors,
    move_robot,
    write_milling_path,
)

UR10 = ROBOTS / "ur10.yaml"
WRENCH = ["fx", "fy", "fz", "mx", "my", "mz"]
ANGLES = [f"q{joint}" for joint in range(1, 7)]


@pytest.fixture(scope="module")
def robot():
    return build_hidden_robot(UR10, 4, ["joint_tilt"])[0]


DOCUMENT = {
    "targets": {"T": {"point": "6DoF", "offset_m": (0.0, 0.0, 0.0)}},
    "frame": "base",
    "measured": "pose",
}


def test_a_sheet_is_filled_near_the_declared_poses_and_with_noise(robot, tmp_path):
    angles = np.random.default_rng(1).uniform(-1, 1, (5, 6))
    path = tmp_path / "sheet.csv"
    sheet = pd.DataFrame(angles, columns=ANGLES)
    sheet = sheet.assign(pose=range(5), load=0, repeat=0, target="T")
    sheet.assign(**dict.fromkeys(WRENCH, 0.0)).to_csv(path, index=False)
    assert fill_sheet(path, DOCUMENT, robot, 1) == 5
    filled = pd.read_csv(path)
    measured = filled[["x", "y", "z"]].to_numpy()
    declared = analysed("ur10")
    position, rotation = compute_poses(
        declared.chain, declared.model_angles(angles), declared.chain.end_effector
    )
    deviation_m = np.linalg.norm(measured - position, axis=1)
    assert deviation_m.min() > 1e-5
    assert deviation_m.max() < 0.02
    measured_rotation = Rotation.from_rotvec(filled[["rx", "ry", "rz"]].to_numpy())
    deviation = measured_rotation * Rotation.from_matrix(rotation).inv()
    assert deviation.magnitude().max() < 0.05
    reached, _ = move_robot(robot, angles, np.zeros((5, 6)), 9)
    assert 1e-6 < np.abs(measured - reached).max() < 5e-4


def test_the_hidden_effect_follows_from_the_seed_or_is_named():
    effects = {build_hidden_robot(UR10, seed)[1][-1].effect for seed in range(12)}
    assert len(effects) > 3
    assert build_hidden_robot(UR10, 3)[1] == build_hidden_robot(UR10, 3)[1]
    with pytest.raises(InputError, match="rust"):
        build_hidden_robot(UR10, 3, ["rust"])


def test_uncorrected_and_corrected_targets_are_judged_at_the_wanted_poses(
    robot, tmp_path
):
    path = tmp_path / "path.csv"
    targets = tmp_path / "targets.csv"
    assert write_milling_path(path, analysed("ur10"), robot, 1) == 50
    wanted = read_target_path(path, 6)
    assert len(wanted) == 50
    assert wanted.wrench[:, 2].min() > 0
    # The uncorrected targets belong to another posture, so the robot misses by more.
    angles = pd.read_csv(path)[ANGLES]
    angles.join(angles.add_suffix("_uncorrected") + 1e-2).to_csv(targets, index=False)
    errors_m = measure_errors(path, targets, robot, 1)
    assert set(errors_m) == {"uncorrected", "corrected", "noise alone"}
    assert {distances.shape for distances in errors_m.values()} == {(50,)}
    assert errors_m["uncorrected"].mean() > 2 * errors_m["corrected"].mean()
    # Noise of 60 µm in three coordinates is 104 µm, with a standard error of 5 %.
    noise_rms_m = np.sqrt((errors_m["noise alone"] ** 2).mean())
    assert 0.8e-4 < noise_rms_m < 1.3e-4


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "No columns"),
        ("pose\n1\n", "'load'"),
        ("pose,load,repeat\n1,x,0\n", "load, line 2"),
        ("a,b\n1,2,3\n1\n", "columns"),
    ],
)
def test_a_file_that_is_no_sheet_is_refused_in_one_line(robot, tmp_path, text, message):
    path = tmp_path / "measurements.csv"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=message):
        fill_sheet(path, DOCUMENT, robot, 1)
