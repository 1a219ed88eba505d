"""Only a robot that was measured at corrected targets is called measured."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
import yaml
from analysed_robots import ROBOTS
from made_calibrated import made_calibrated
from scipy.spatial.transform import Rotation

from elastocal.application.calibrated import nominal_forward
from elastocal.errors import InputError
from elastocal.loop.measured import measured_errors

COUNT, SIGMA = 40, 3e-5
DRAWN = np.random.default_rng(1).standard_normal((2, COUNT, 3)) / np.sqrt(3.0)


@pytest.fixture
def diagnosed(kuka):
    calibrated = made_calibrated(kuka, "joint_offset@2")
    return SimpleNamespace(name="made", calibrated=replace(calibrated, noise=replace(calibrated.noise, position_m=SIGMA)))


def corrected_folder(folder, robot, error_m=1e-4, frame="base", offset=(0.0, 0.0, 0.0), stated=None, noise_m=SIGMA):
    """A robot that misses each corrected target by an error of its own, and a tracker with noise."""
    folder.mkdir()
    angles = np.random.default_rng(2).uniform(-0.8, 0.8, (COUNT, 6)) + robot.joint_limits.mean(axis=1)
    angles = robot.reported_angles(angles)
    position, rotation = nominal_forward(robot, angles)
    columns = np.column_stack([angles, position, Rotation.from_matrix(rotation).as_rotvec()])
    names = [*(f"q{joint}" for joint in range(1, 7)), "x", "y", "z", "rx", "ry", "rz"]
    pd.DataFrame(columns, columns=names).assign(status="ok").to_csv(folder / "targets.csv", index=False)
    seen = position + rotation @ np.array(offset) + error_m * DRAWN[0] + np.sqrt(3.0) * noise_m * DRAWN[1]
    if frame == "tracker":
        seen = seen @ Rotation.from_rotvec([0.3, -1.0, 2.0]).as_matrix().T + [4.0, -2.0, 1.0]
    read = [*names[:6], "fx", "fy", "fz", "mx", "my", "mz", "x", "y", "z"]
    rows = pd.DataFrame(np.column_stack([angles, np.zeros((COUNT, 6)), seen]), columns=read)
    rows = rows.assign(pose=np.arange(1, COUNT + 1), load=0, repeat=0, target="T")
    rows.to_csv(folder / "measurements.csv", index=False)
    point = robot.chain.end_effector.name
    target = {"point": point, "offset_m": stated or [0, 0, 0]}
    document = {"campaign": "after", "robot": "kuka", "measured": "position", "frame": frame, "targets": {"T": target}}
    (folder / "campaign.yaml").write_text(yaml.safe_dump(document))
    return folder


def change_table(path, change):
    change(pd.read_csv(path)).to_csv(path, index=False)


@pytest.mark.parametrize(
    ("frame", "offset", "stated"),
    [
        ("base", (0, 0, 0), None),
        ("tracker", (0, 0, 0), None),
        ("tracker", (0.05, -0.08, 0.1), "unknown"),
        ("base", (0.05, -0.08, 0.1), "unknown"),
    ],
)
def test_the_error_is_that_of_the_robot_without_the_trackers_noise(tmp_path, kuka, diagnosed, frame, offset, stated):
    folder = corrected_folder(tmp_path / "after", kuka, frame=frame, offset=offset, stated=stated)
    found = measured_errors(folder, ROBOTS, diagnosed)
    accuracy = found.accuracy
    assert (accuracy.kind, accuracy.frame) == ("measured", "base" if frame == "base" else "robot")
    assert accuracy.offset_removed == (stated is not None)
    # The placement takes up 6 or 9 of 120 numbers of the errors too.
    assert accuracy.rms_m == pytest.approx(1e-4 * np.sqrt((DRAWN[0] ** 2).sum(axis=1).mean()), rel=0.1)
    assert accuracy.rms_m < accuracy.rms_bound_m < 1.5 * accuracy.rms_m
    assert np.sqrt((found.errors.distance**2).mean()) > accuracy.rms_m


def test_noise_alone_is_no_error(tmp_path, kuka, diagnosed):
    found = measured_errors(corrected_folder(tmp_path / "after", kuka, error_m=0.0), ROBOTS, diagnosed).accuracy
    assert found.rms_m < 0.5 * np.sqrt(3.0) * SIGMA


def test_a_base_that_is_off_its_declaration_is_an_error(tmp_path, kuka, diagnosed):
    folder = corrected_folder(tmp_path / "after", kuka)
    change_table(folder / "measurements.csv", lambda rows: rows.assign(z=rows["z"] + 5e-4))
    assert measured_errors(folder, ROBOTS, diagnosed).accuracy.rms_m > 4.5e-4


@pytest.mark.parametrize(
    ("table", "change", "message"),
    [
        ("measurements.csv", lambda rows: rows.assign(q1=rows["q1"] + 1e-2), "row 1: found other joint angles"),
        ("measurements.csv", lambda rows: rows.assign(pose=rows["pose"] + 1), "1..40, the rows of targets.csv"),
        ("measurements.csv", lambda rows: rows[:8], "12 or more"),
        ("targets.csv", lambda rows: rows.drop(columns="x"), "no column 'x'"),
        ("targets.csv", lambda rows: rows.assign(status="unreachable"), "a target that was not corrected"),
        ("targets.csv", lambda rows: rows.assign(y="here"), "'here'"),
    ],
)
def test_measurements_elsewhere_and_targets_that_correct_did_not_write_are_refused(
    tmp_path, kuka, diagnosed, table, change, message
):
    folder = corrected_folder(tmp_path / "after", kuka)
    change_table(folder / table, change)
    with pytest.raises(InputError, match=message):
        measured_errors(folder, ROBOTS, diagnosed)


def test_targets_that_are_missing_are_named(tmp_path, kuka, diagnosed):
    folder = corrected_folder(tmp_path / "after", kuka)
    (folder / "targets.csv").unlink()
    with pytest.raises(InputError, match=r"targets\.csv"):
        measured_errors(folder, ROBOTS, diagnosed)
