"""DH parameters of a robot: they bring back its poses, and change as little as the robot does."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from analysed_robots import ROBOTS, analysed
from made_calibrated import USUAL, made_calibrated
from support import refused, robot_of

from elastocal.application.exported import fold_effects
from elastocal.exchange.dh import robot_from_dh
from elastocal.exchange.dh_writing import PARAMETERS, dh_deltas, dh_table
from elastocal.mechanics.kinematics import poses

NAMES = sorted(path.stem for path in ROBOTS.glob("*.yaml"))


def flange(robot, reported):
    return poses(robot.chain, robot.model_angles(reported), robot.chain.end_effector)


def assert_same(robot, other, count=50):
    reported = np.random.default_rng(1).uniform(-2, 2, (count, robot.joints))
    angles = robot.model_angles(reported) if robot.counts_each_joint else reported
    for mine, theirs in zip(poses(robot.chain, angles, robot.chain.end_effector), flange(other, reported), strict=True):
        np.testing.assert_allclose(theirs, mine, atol=1e-9)


def read_back(robot, folder, nominal=None):
    dh_table(robot, nominal).to_csv(folder / "dh.csv", index=False)
    return robot_from_dh(folder / "dh.csv").robot


@pytest.mark.parametrize("name", NAMES)
def test_the_table_of_every_robot_reads_back_to_its_poses(name, tmp_path):
    robot = analysed(name)
    assert_same(robot, read_back(robot, tmp_path))


@pytest.mark.parametrize("name", ["fanuc", "kuka", "iiwa14"])
def test_a_calibrated_robot_reads_back_and_its_deltas_are_as_small_as_its_errors(name, tmp_path):
    nominal = analysed(name)
    robot = fold_effects(made_calibrated(nominal, *USUAL[:-2])).robot
    assert_same(robot, read_back(robot, tmp_path, nominal))
    deltas = dh_deltas(nominal, robot)
    assert list(deltas["row"]) == ["base", *(f"q{j}" for j in range(1, nominal.joints + 1)), nominal.chain.end_effector.name]
    # Errors of up to 0.3 mm and 0.3 mrad, as seen by feet of normals some metres away.
    assert deltas[[f"delta_{p}" for p in PARAMETERS if p.endswith("_m")]].abs().to_numpy().max() < 5e-3
    assert deltas[[f"delta_{p}" for p in PARAMETERS if p.endswith("_deg")]].abs().to_numpy().max() < 0.3
    assert deltas["delta_theta_deg"].abs().max() > 0
    assert not dh_deltas(nominal, nominal)[[f"delta_{p}" for p in PARAMETERS]].to_numpy().any()


def test_a_tilt_of_parallel_axes_is_beta_and_not_a_kilometre(tmp_path):
    nominal = robot_of("Rz(q1) Tx(1.0) Rz(q2) Tx(0.5) [tip]")
    tilted = robot_of("Rz(q1) Tx(1.0) Rx(0.01deg) Ry(0.02deg) Rz(q2) Tx(0.5) [tip]")
    deltas = dh_deltas(nominal, tilted).set_index("row")
    assert deltas.loc["q1", ["delta_beta_deg", "delta_alpha_deg"]].tolist() == pytest.approx([0.02, 0.01])
    assert deltas["delta_d_m"].abs().max() < 1e-6
    assert_same(tilted, read_back(tilted, tmp_path, nominal))


def test_angles_are_the_controllers_where_it_counts_each_joint_by_itself(tmp_path):
    robot = robot_of("Rz(q1) Tx(1.0) Ry(q2) Tx(0.5) [tip]")
    turned = replace(robot, reported_matrix=np.diag([-1.0, 1.0]), reported_offset=np.array([0.3, -0.2]))
    assert_same(turned, read_back(turned, tmp_path))
    coupled = replace(robot, reported_matrix=np.array([[1.0, 0.0], [1.0, 1.0]]))
    pd.testing.assert_frame_equal(dh_table(coupled), dh_table(robot), check_exact=True)


def test_prismatic_joints_are_refused():
    with refused("", "chain", "revolute"):
        dh_table(robot_of("Tz(q1) Ry(q2) [tip]"))
