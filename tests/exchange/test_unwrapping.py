"""Angles counted over a turn come into the limits of their joints, or stay."""

from dataclasses import replace

import numpy as np
import pytest
from imported_tables import PLAIN, table
from support import robot_of

from elastocal.exchange.unwrapping import unwrap_into_limits

LIMITS = np.radians([[-130.0, 130.0], [-360.0, 360.0]])
ROBOT = replace(robot_of("Rz(q1) Tx(1) Ry(q2) [A]"), joint_limits=LIMITS)


def unwrap(column, robot=ROBOT):
    reported = np.radians(np.column_stack([column, np.full(len(column), 350.0)]))
    angles, notes = unwrap_into_limits(reported, robot, ["Actuator1", "Actuator2"])
    np.testing.assert_array_equal(angles[:, 1], reported[:, 1])
    return np.degrees(angles[:, 0]), notes


def test_angles_counted_from_0_to_360_come_into_the_limits(tmp_path):
    angles, notes = unwrap([12.5, 359.9991, 0.0, 245.0])
    np.testing.assert_allclose(angles, [12.5, -0.0009, 0.0, -115.0], atol=1e-9)
    assert len(notes) == 1 and "'Actuator1'" in notes[0] and "2 of 4 angles" in notes[0]


def test_one_note_names_all_joints_that_were_moved():
    robot = replace(ROBOT, joint_limits=np.radians([[-130.0, 130.0]] * 2))
    reported = np.radians([[12.5, 350.0], [359.0, 20.0], [0.0, 340.0]])
    angles, notes = unwrap_into_limits(reported, robot, ["Actuator1", "Actuator2"])
    expected = [[12.5, -10.0], [-1.0, 20.0], [0.0, -20.0]]
    np.testing.assert_allclose(np.degrees(angles), expected, atol=1e-9)
    (note,) = notes
    assert "'Actuator1', 'Actuator2'; 3 of 6 angles" in note


def test_angles_counted_from_minus_180_come_into_limits_above(tmp_path):
    limits = np.radians([[10.0, 350.0], [-360.0, 360.0]])
    angles, _ = unwrap([-170.0, 20.0], replace(ROBOT, joint_limits=limits))
    np.testing.assert_allclose(angles, [190.0, 20.0])


@pytest.mark.parametrize(
    "column",
    [
        # No turn takes 200 degrees into the limits.
        [12.5, 359.0, 200.0],
        # A joint that counts more than a turn, or both ways, is not counted so.
        [12.5, 359.0, 370.0],
        [-10.0, 359.0],
        # Within the limits, or by a servo's error beyond.
        [-130.1, 130.1],
    ],
)
def test_other_angles_stay(column):
    angles, notes = unwrap(column)
    np.testing.assert_allclose(angles, column)
    assert notes == []


def test_coupled_joints_and_rails_stay():
    coupled = replace(ROBOT, reported_matrix=np.array([[1.0, 0.0], [-1.0, 1.0]]))
    assert unwrap([359.0, 1.0], coupled)[1] == []
    rail = robot_of("Tx(q1) Ry(q2) [A]")
    rail = replace(rail, joint_limits=np.array([[-1.0, 1.0], [-7.0, 7.0]]))
    assert unwrap([359.0, 1.0], rail)[1] == []


def test_a_joint_near_zero_stands_in_one_pose(tmp_path):
    text = "J1;J2;x;y;z\n359.999;10;1;2;3\n0.001;10;1;2;3\n"
    imported = table(tmp_path, text, PLAIN, ROBOT)
    assert imported.table["pose"].tolist() == [1, 1]
    assert imported.table["repeat"].tolist() == [0, 1]
    assert any("whatever the limits: 'J1'" in note for note in imported.notes)
