"""Kinematics files of ROS drivers become the robot that a URDF of the same origins is."""

import numpy as np
import pinocchio as pin
import pytest
import yaml
from support import refused

from elastocal.exchange.dh import robot_from_dh
from elastocal.exchange.robot_text import robot_text
from elastocal.mechanics.kinematics import poses
from elastocal.mechanics.robot_file import robot_from_document

PARTS = ("shoulder", "upper_arm", "forearm", "wrist_1", "wrist_2", "wrist_3")
KEYS = ("x", "y", "z", "roll", "pitch", "yaw")
ORIGINS = {
    "shoulder": (0, 0, 0.0888794492754001, 0, 0, -9.62e-06),
    "upper_arm": (0.00027933, 0, 0, 1.570338588, 0, 2.15e-05),
    "forearm": (-0.425, 1e-05, 0, 0.001, -0.002, 0.0003),
    "wrist_1": (-0.392, 0, 0.1103, 0.003, 0, -2e-05),
    "wrist_2": (0, -0.095, 0, 1.5704, 0, 2.55e-05),
    "wrist_3": (0, 0.0823, 0, 1.5705, 3.141592653, 3.1415926),
}


def write(folder, links, **beside):
    path = folder / "calib.yaml"
    described = {name: dict(zip(KEYS, origin, strict=True)) for name, origin in links.items()}
    path.write_text(yaml.safe_dump({"kinematics": described | beside}, sort_keys=False))
    return path


@pytest.mark.parametrize("order", [1, -1])
def test_a_calibrated_arm_is_where_its_origins_put_it(tmp_path, order):
    path = write(tmp_path, {name: ORIGINS[name] for name in PARTS[::order]}, hash="calib_7")
    result = robot_from_dh(path, name="ur5")
    robot = robot_from_document(yaml.safe_load(robot_text(result)))
    wrist = "wrist_1_joint", "wrist_2_joint", "wrist_3_joint"
    assert robot.joint_names == ("shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint", *wrist)
    assert robot.chain.end_effector.name == "wrist_3" and any("base_link" in note for note in result.notes)
    q = np.random.default_rng(0).uniform(-3, 3, (5, 6))
    position, rotation = poses(robot.chain, q, robot.chain.end_effector)
    for number, angles in enumerate(q):
        at = pin.SE3.Identity()
        for name, angle in zip(PARTS, angles, strict=True):
            *shift, roll, pitch, yaw = ORIGINS[name]
            at = at * pin.SE3(pin.rpy.rpyToMatrix(roll, pitch, yaw), np.array(shift, float))
            at = at * pin.SE3(pin.exp3(angle * np.eye(3)[2]), np.zeros(3))
        np.testing.assert_allclose(position[number], at.translation, rtol=0, atol=1e-9)
        np.testing.assert_allclose(rotation[number], at.rotation, rtol=0, atol=1e-9)


@pytest.mark.parametrize(
    ("document", "key", "words"),
    [
        ({"kinematics": 3}, "kinematics", ["int", "roll"]),
        ({"kinematics": {}}, "kinematics", ["no link"]),
        ({"kinematics": {"hash": "x"}}, "kinematics", ["no link"]),
        ({"kinematics": {"shoulder": {"x": 1}}}, "kinematics.shoulder", ["found x;", "roll"]),
        ({"kinematics": {"shoulder": [1, 2]}}, "kinematics.shoulder", ["list"]),
        ({"kinematics": {"shoulder": dict.fromkeys(KEYS, "a")}}, "kinematics.shoulder.x", ["'a'"]),
        ({"kinematics": dict.fromkeys(("shoulder", "forearm"), dict.fromkeys(KEYS, 0))}, "kinematics", ["no link upper_arm"]),
    ],
)
def test_what_is_no_kinematics_is_refused(tmp_path, document, key, words):
    (tmp_path / "calib.yaml").write_text(yaml.safe_dump(document))
    with refused(tmp_path / "calib.yaml", key, *words):
        robot_from_dh(tmp_path / "calib.yaml")


def test_no_notation_of_tables_goes_with_it(tmp_path):
    with refused("--modified", "", "kinematics"):
        robot_from_dh(write(tmp_path, ORIGINS), modified=True)
