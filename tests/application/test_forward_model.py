"""The calibrated robot as a document and as a class: the same robot, to the bit."""

import json
from dataclasses import replace

import numpy as np
import pytest
from analysed_robots import analysed
from made_calibrated import made_calibrated
from scipy.spatial.transform import Rotation
from support import refused

from elastocal.application.accuracy import Accuracy
from elastocal.application.calibrated import OperatingConditions, forward, prediction_covariance
from elastocal.application.forward_model import KEY, SIDECAR, ForwardModel, model_document, read_calibrated
from elastocal.application.sidecar import sidecar

KEYS = ("joint_offset@2", "link_geometry@3", "lost_motion@2", "transmission_harmonic@1[orders 1-2]", "thermal_growth[time]")


def states(robot, count=20):
    rng = np.random.default_rng(1)
    wrench = 100 * rng.standard_normal((count, 6))
    return rng.uniform(-1, 1, (count, robot.joints)), OperatingConditions(wrench, None, np.full(count, 3600.0))


ACCURACY = Accuracy("base", "predicted", 1e-5, 2e-5, 3e-5, 4e-5, "none", 1, "one pose")


def through_json(calibrated):
    return read_calibrated(json.loads(json.dumps(model_document(calibrated), allow_nan=False)), "effects.json")


@pytest.mark.parametrize("name", ["gp180", "fanuc", "iiwa14"])
def test_a_robot_with_weights_and_effects_comes_back_as_it_was(name):
    calibrated = made_calibrated(analysed(name), *KEYS)
    calibrated = replace(calibrated, model=replace(calibrated.model, time_zero_s=120.0))
    back = through_json(calibrated)
    angles, operating = states(calibrated.robot)
    for one, other in zip(forward(calibrated, angles, operating), forward(back, angles, operating), strict=True):
        np.testing.assert_array_equal(other, one)
    found, expected = (prediction_covariance(each, angles, operating) for each in (back, calibrated))
    np.testing.assert_array_equal(found, expected)
    np.testing.assert_array_equal(back.noise.joint_rad, calibrated.noise.joint_rad)


def test_a_folder_gives_poses_and_targets_that_reach_them(tmp_path):
    calibrated = made_calibrated(analysed("kuka"), "joint_offset@2", "lost_motion@3")
    (tmp_path / SIDECAR).write_text(json.dumps(sidecar(calibrated, "cell", "2026-11-23", ACCURACY)))
    model = ForwardModel.read(tmp_path)
    angles = analysed("kuka").joint_limits.mean(axis=1) + np.array([0.1, 0.2, 0.1, 0.3, 0.7, 0.0])
    position, rotation = model.pose([angles])
    targets = model.joint_targets(position, rotation, start=angles[None])
    assert targets.status.tolist() == ["ok"]
    reached = model.pose(targets.joint_angles)
    np.testing.assert_allclose(reached[0], position, atol=1e-8)
    assert (Rotation.from_matrix(reached[1]) * Rotation.from_matrix(rotation).inv()).magnitude().max() < 1e-7


def test_effects_that_this_version_does_not_have_are_refused(tmp_path):
    document = model_document(made_calibrated(analysed("kuka"), "joint_offset@2"))
    unknown = document | {"effects": [*document["effects"], {"key": "magic@1", "values": [1.0], "shapes": []}]}
    with refused("effects.json", f"{KEY}.effects[2]", "'magic@1'"):
        read_calibrated(unknown, "effects.json")
    other = document | {"effects": [document["effects"][0], document["effects"][1] | {"values": [1.0, 2.0]}]}
    with refused("effects.json", f"{KEY}.effects[1]", "2 values", "1, as joint_offset@2"):
        read_calibrated(other, "effects.json")
    (tmp_path / SIDECAR).write_text("{}")
    with refused((tmp_path / SIDECAR).as_posix(), KEY, "elastocal export"):
        ForwardModel.read(tmp_path)
