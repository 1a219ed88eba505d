"""DH parameters of a robot: they bring back its poses, and change as little as the robot does."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from analysed_robots import ROBOTS, analysed
from made_calibrated import USUAL, made_calibrated
from support import refused, robot_of

from elastocal.application.exported import fold_effects
from elastocal.exchange.dh_writing import PARAMETERS, dh_deltas
from elastocal.mechanics.kinematics import poses

NAMES = sorted(path.stem for path in ROBOTS.glob("*.yaml"))


def assert_stands_as(robot, deltas):
    """Whether the rows of a table, ``Rz(theta) Tz(d) Tx(a) Rx(alpha) Ty(b) Ry(beta)``, make the poses of a robot."""
    rows = deltas[list(PARAMETERS)].to_numpy(copy=True)
    rows[:, [0, 3, 5]] = np.radians(rows[:, [0, 3, 5]])
    for reported in np.random.default_rng(1).uniform(-2, 2, (20, robot.joints)):
        angles = robot.model_angles(reported[None]) if robot.counts_each_joint else reported[None]
        position, rotation = poses(robot.chain, angles, robot.chain.end_effector)
        at = pin.SE3.Identity()
        for (theta, d, a, alpha, b, beta), joint in zip(rows, [0.0, *reported, 0.0], strict=True):
            for axis, turn, shift in ((2, theta + joint, d), (0, alpha, a), (1, beta, b)):
                at = at * pin.SE3(pin.exp3(turn * np.eye(3)[axis]), shift * np.eye(3)[axis])
        np.testing.assert_allclose(at.translation, position[0], atol=1e-9)
        np.testing.assert_allclose(at.rotation, rotation[0], atol=1e-9)


@pytest.mark.parametrize("name", NAMES)
def test_the_rows_of_every_robot_make_its_poses(name):
    robot = analysed(name)
    deltas = dh_deltas(robot, robot)
    assert_stands_as(robot, deltas)
    assert not deltas[[f"delta_{p}" for p in PARAMETERS]].to_numpy().any()


@pytest.mark.parametrize("name", ["fanuc", "kuka", "iiwa14"])
def test_a_calibrated_robots_deltas_are_as_small_as_its_errors(name):
    nominal = analysed(name)
    robot = fold_effects(made_calibrated(nominal, *USUAL[:-2])).robot
    deltas = dh_deltas(nominal, robot)
    assert_stands_as(robot, deltas)
    assert list(deltas["row"]) == ["base", *(f"q{j}" for j in range(1, nominal.joints + 1)), nominal.chain.end_effector.name]
    # Errors of up to 0.3 mm and 0.3 mrad, as seen by feet of normals some metres away.
    assert deltas[[f"delta_{p}" for p in PARAMETERS if p.endswith("_m")]].abs().to_numpy().max() < 5e-3
    assert deltas[[f"delta_{p}" for p in PARAMETERS if p.endswith("_deg")]].abs().to_numpy().max() < 0.3
    assert deltas["delta_theta_deg"].abs().max() > 0


def test_a_tilt_of_parallel_axes_is_beta_and_not_a_kilometre():
    nominal = robot_of("Rz(q1) Tx(1.0) Rz(q2) Tx(0.5) [tip]")
    tilted = robot_of("Rz(q1) Tx(1.0) Rx(0.01deg) Ry(0.02deg) Rz(q2) Tx(0.5) [tip]")
    deltas = dh_deltas(nominal, tilted)
    assert_stands_as(tilted, deltas)
    assert deltas.loc[1, ["delta_beta_deg", "delta_alpha_deg"]].tolist() == pytest.approx([0.02, 0.01])
    assert deltas["delta_d_m"].abs().max() < 1e-6


def test_angles_are_the_controllers_where_it_counts_each_joint_by_itself():
    robot = robot_of("Rz(q1) Tx(1.0) Ry(q2) Tx(0.5) [tip]")
    turned = replace(robot, reported_matrix=np.diag([-1.0, 1.0]), reported_offset=np.array([0.3, -0.2]))
    assert_stands_as(turned, dh_deltas(turned, turned))
    coupled = replace(robot, reported_matrix=np.array([[1.0, 0.0], [1.0, 1.0]]))
    assert dh_deltas(coupled, coupled).equals(dh_deltas(robot, robot))


@pytest.mark.parametrize("chain", ["Tz(q1) Ry(q2) [tip]", "Ry(q1) Tx(0.5) Ry(q2) Tx(0.2) Ry(-q2) [tip]"])
def test_prismatic_and_passive_joints_are_refused(chain):
    with refused("", "chain", "revolute"):
        dh_deltas(robot_of(chain), robot_of(chain))
