"""Files of a rehearsal, from an empty sheet to by how much the robot misses a path."""

import numpy as np
import pandas as pd
import pytest
from analysed_robots import ROBOTS, analysed

from elastocal.errors import InputError
from elastocal.exchange.target_path import read_target_path
from elastocal_proof.blind.rehearsal import hidden_robot
from elastocal_proof.blind.rehearsal_files import fill_sheet, lose_beam, measured_errors, write_milling_path


@pytest.fixture(scope="module")
def robot():
    return hidden_robot(ROBOTS / "ur10.yaml", 4, ["joint_tilt"])[0]


def test_a_sheet_is_filled_in_place(robot, tmp_path):
    state = {"pose": 1, "load": 0, "repeat": 0, "target": "T"} | dict.fromkeys(["fx", "fy", "fz", "mx", "my", "mz"], 0.0)
    path = tmp_path / "measurements.csv"
    pd.DataFrame([state | {f"q{j}": 0.1 * j for j in range(1, 7)}]).to_csv(path, index=False)
    document = {"targets": {"T": {"point": "6DoF", "offset_m": [0, 0, 0]}}, "frame": "base", "measured": "position"}
    assert fill_sheet(path, document, robot, 1) == 1
    assert np.isfinite(pd.read_csv(path)[["x", "y", "z"]].to_numpy()).all()


def test_uncorrected_and_corrected_targets_are_judged_at_the_wanted_poses(robot, tmp_path):
    path, targets = tmp_path / "path.csv", tmp_path / "targets.csv"
    assert write_milling_path(path, analysed("ur10"), robot, 1) == 50
    wanted = read_target_path(path, 6)
    assert len(wanted) == 50 and wanted.wrench[:, 2].min() > 0
    # Where the second set of targets is another robot's posture it misses by more.
    angles = pd.read_csv(path)[[f"q{j}" for j in range(1, 7)]]
    angles.join(angles.add_suffix("_uncorrected") + 1e-2).to_csv(targets, index=False)
    missed = measured_errors(path, targets, robot, 1)
    assert {name: off.shape for name, off in missed.items()} == dict.fromkeys(
        ["uncorrected", "corrected", "noise alone"], (50,)
    )
    assert missed["uncorrected"].mean() > 2 * missed["corrected"].mean()
    # Three coordinates with 60 µm of noise: 104 µm, with 5 % of standard error.
    assert 0.8e-4 < np.sqrt((missed["noise alone"] ** 2).mean()) < 1.3e-4


def test_one_row_of_a_sheet_reads_zeros_after_a_lost_beam(tmp_path):
    path = tmp_path / "measurements.csv"
    before = pd.DataFrame({"x": [1.0, 2.0, 3.0], "y": [1.0, 2.0, 3.0], "z": [1.0, 2.0, 3.0]})
    before.to_csv(path, index=False)
    line = lose_beam(path, 1)
    after = pd.read_csv(path)
    assert (after.iloc[line - 2] == 0).all() and after.drop(line - 2).equals(before.drop(line - 2))


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
        fill_sheet(path, {"targets": {}, "frame": "base", "measured": "pose"}, robot, 1)
