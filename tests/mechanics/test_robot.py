"""A robot: its angles as the controller reports them, and targets on all of its points."""

from dataclasses import replace

import numpy as np
from support import robot_of

from elastocal.mechanics.robot import Mass, with_rigid_joints


def test_reported_angles_are_converted_both_ways():
    matrix, offset = np.array([[1.0, 0.0], [1.0, -1.0]]), np.radians([90.0, -45.0])
    robot = replace(robot_of("Rz(q1) Tx(1) Ry(q2) [A]"), reported_matrix=matrix, reported_offset=offset)
    reported = np.radians([[10.0, 20.0], [-30.0, 5.0], [0.0, 0.0]])
    angles = np.radians([[100.0, -55.0], [60.0, -80.0], [90.0, -45.0]])
    np.testing.assert_allclose(robot.model_angles(reported), angles, rtol=1e-12)
    np.testing.assert_allclose(robot.reported_angles(angles), reported, atol=1e-12)
    np.testing.assert_allclose(robot.model_angles(reported[0]), angles[0], rtol=1e-12)


def test_rigid_joints_yield_to_nothing():
    robot = replace(robot_of("Rz(q1) Tx(1) Ry(q2) [A]"), masses=(Mass(2, 1.0, (0.1, 0.0, 0.0), 0.1),))
    rigid = with_rigid_joints(robot)
    assert not rigid.compliance.any() and rigid.masses == () and not rigid.compliance_known
    assert rigid.chain == robot.chain
