"""A robot as URDF, where pinocchio has it and as it is read back."""

import mujoco
import numpy as np
import pytest
from analysed_robots import analysed
from made_urdf import Pinocchio

from elastocal.exchange.urdf import robot_from_urdf
from elastocal.exchange.urdf_writing import urdf_of
from elastocal.mechanics.kinematics import poses

ROBOTS = ("gp180", "iiwa14", "ur10", "fanuc_static", "abb", "wam", "kuka")


def write_urdf(folder, robot):
    path = folder / "arm.urdf"
    path.write_text(urdf_of(robot, "made for a test"))
    return path


def draw_angles(robot):
    low, high = robot.joint_limits.T
    return low + (high - low) * np.random.default_rng(2).random((12, robot.joints))


@pytest.mark.parametrize("name", ROBOTS)
def test_read_back_it_is_the_robot_that_the_controller_moves(tmp_path, name):
    robot = analysed(name)
    end = robot.chain.end_effector
    others = [point.name for point in robot.chain.points[:-1]]
    back = robot_from_urdf(write_urdf(tmp_path, robot), "base", end.name, others).robot
    angles = draw_angles(robot)
    own = np.abs(robot.reported_matrix).tolist() == np.eye(robot.joints).tolist()
    values = robot.reported_angles(angles) if own else angles
    for point in robot.chain.points:
        mine, theirs = (poses(r.chain, q, r.chain.point(point.name)) for r, q in ((robot, angles), (back, values)))
        np.testing.assert_allclose(theirs[0], mine[0], atol=1e-9)
        np.testing.assert_allclose(theirs[1], mine[1], atol=1e-9)
    assert [mass.mass_kg for mass in back.masses] == [m.mass_kg for m in robot.masses]


@pytest.mark.parametrize("name", ROBOTS)
def test_mujoco_loads_it_and_no_joint_is_without_effort_or_speed(tmp_path, name):
    robot = analysed(name)
    path = write_urdf(tmp_path, robot)
    model, by_pinocchio = mujoco.MjModel.from_xml_path(str(path)), Pinocchio(path).model
    assert model.nv >= robot.joints and (model.body_inertia[1:] > 0).all()
    assert (by_pinocchio.effortLimit > 0).all() and (by_pinocchio.velocityLimit > 0).all()
    heavy = sum(mass.mass_kg for mass in robot.masses if mass.link)
    assert model.body_mass[1:].sum() == pytest.approx(heavy, abs=1e-4)
