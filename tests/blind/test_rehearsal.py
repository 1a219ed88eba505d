"""The robot that stands in for a real one: what it writes into a measurement sheet, and
where it goes."""

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


@pytest.fixture(scope="module")
def robot():
    return build_hidden_robot(UR10, 4, ["joint_tilt"])[0]


DOCUMENT = {
    "targets": {"T": {"point": "6DoF", "offset_m": (0.0, 0.0, 0.0)}},
    "frame": "base",
    "measured": "pose",
}


def test_a_sheet_is_filled_near_where_the_declared_robot_is_and_by_where_commands_reach(
    robot, tmp_path
):
    angles = np.random.default_rng(1).uniform(-1, 1, (5, 6))
    declared = analysed("ur10")
    path = tmp_path / "sheet.csv"
    joints = {f"q{j + 1}": angle for j, angle in enumerate(angles.T)} | dict.fromkeys(
        WRENCH, 0.0
    )
    pd.DataFrame(
        {"pose": range(5), "load": 0, "repeat": 0, "target": "T"} | joints
    ).to_csv(path, index=False)
    assert fill_sheet(path, DOCUMENT, robot, 1) == 5
    filled = pd.read_csv(path)
    position, rotation = compute_poses(
        declared.chain, declared.model_angles(angles), declared.chain.end_effector
    )
    off = np.linalg.norm(filled[["x", "y", "z"]].to_numpy() - position, axis=1)
    assert off.min() > 1e-5 and off.max() < 0.02
    turn = (
        Rotation.from_rotvec(filled[["rx", "ry", "rz"]].to_numpy())
        * Rotation.from_matrix(rotation).inv()
    )
    assert turn.magnitude().max() < 0.05
    noise = (
        filled[["x", "y", "z"]].to_numpy()
        - move_robot(robot, angles, np.zeros((5, 6)), 9)[0]
    )
    assert 1e-6 < np.abs(noise).max() < 5e-4


def test_the_hidden_effect_follows_from_the_seed_or_is_named(tmp_path):
    drawn = {build_hidden_robot(UR10, seed)[1][-1].effect for seed in range(12)}
    assert len(drawn) > 3
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
    assert len(wanted) == 50 and wanted.wrench[:, 2].min() > 0
    # Where the second set of targets is another robot's posture it misses by more.
    angles = pd.read_csv(path)[[f"q{j}" for j in range(1, 7)]]
    angles.join(angles.add_suffix("_uncorrected") + 1e-2).to_csv(targets, index=False)
    missed = measure_errors(path, targets, robot, 1)
    assert {name: off.shape for name, off in missed.items()} == dict.fromkeys(
        ["uncorrected", "corrected", "noise alone"], (50,)
    )
    assert missed["uncorrected"].mean() > 2 * missed["corrected"].mean()
    # Three coordinates with 60 µm of noise: 104 µm, with 5 % of standard error.
    assert 0.8e-4 < np.sqrt((missed["noise alone"] ** 2).mean()) < 1.3e-4


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "No columns"),
        ("pose\n1\n", "'load'"),
        ("pose,load,repeat\n1,x,0\n", "load, line 2"),
        ("a,b\n1,2,3\n1\n", "columns"),
    ],
)
def test_a_sheet_that_is_none_is_one_line(robot, tmp_path, text, words):
    path = tmp_path / "measurements.csv"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=words):
        fill_sheet(path, DOCUMENT, robot, 1)
