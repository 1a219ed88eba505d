import numpy as np
import pinocchio as pin
import pytest
from made_urdf import joint, link, written

import elastocal as ec
from elastocal.mechanics.kinematics import compute_poses

CHAIN = "Rz(q1) Tx(0.3) Rz(q2) Tx(0.2) [tool]"


def end_position(robot, angles):
    position, _ = compute_poses(
        robot.chain, np.atleast_2d(angles), robot.chain.end_effector
    )
    return position[0]


def test_chain_as_text_moves_as_a_planar_arm():
    robot = ec.read_robot(CHAIN)
    x = 0.3 * np.cos(0.4) + 0.2 * np.cos(1.1)
    y = 0.3 * np.sin(0.4) + 0.2 * np.sin(1.1)
    np.testing.assert_allclose(end_position(robot, [0.4, 0.7]), [x, y, 0], atol=1e-12)


@pytest.mark.parametrize("modified", [False, True])
def test_rows_of_denavit_and_hartenberg_move_as_pinocchio_says(modified):
    rows = np.random.default_rng(5).uniform(-1, 1, (4, 4))
    angles = np.array([0.2, -0.5, 1.0, 0.3])
    placement = pin.SE3.Identity()
    for (theta, d, a, alpha), angle in zip(rows, angles, strict=True):
        about_x = pin.SE3(pin.exp3(np.array([alpha, 0, 0])), np.array([a, 0, 0]))
        about_z = pin.SE3(
            pin.exp3(np.array([0, 0, theta + angle])), np.array([0, 0, d])
        )
        steps = [about_x, about_z] if modified else [about_z, about_x]
        placement = placement * steps[0] * steps[1]
    robot = ec.read_robot(rows, modified=modified, name="four joints")
    assert robot.name == "four joints"
    np.testing.assert_allclose(
        end_position(robot, angles), placement.translation, atol=1e-9
    )


def test_urdf_needs_base_and_tip(tmp_path):
    path = written(tmp_path, link("a"), link("b"), joint("j", "a", "b"))
    assert ec.read_robot(path, base="a", tip="b").joints == 1
    with pytest.raises(ec.InputError, match="base, tip: found none"):
        ec.read_robot(path)


def test_robot_file_is_read(tmp_path):
    path = tmp_path / "arm.yaml"
    path.write_text(f"name: arm\nchain: {CHAIN}\n", encoding="utf-8")
    assert ec.read_robot(path).name == "arm"


@pytest.mark.parametrize("source", ["arm.step", np.zeros((3, 3)), "Rz(q1) Q(3)"])
def test_what_is_no_robot_is_refused_in_one_line(source):
    with pytest.raises(ec.InputError) as caught:
        ec.read_robot(source)
    assert "\n" not in str(caught.value)
