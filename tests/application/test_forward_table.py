"""The table states what the model does, and how well one interpolates in it."""

import numpy as np
import pytest
from made_calibrated import made_calibrated
from scipy.spatial.transform import Rotation
from support import robot_of

from elastocal.application.calibrated import OperatingConditions, forward
from elastocal.application.forward_table import forward_table, interpolation_error_m

HANGING = OperatingConditions(np.array([[0.0, 0.0, -200.0, 0.0, 0.0, 0.0]]))


@pytest.fixture(scope="module")
def calibrated():
    robot = robot_of("Tz(0.5) Rz(q1) Ry(q2) Tx(0.9) Ry(q3) Tx(0.6) [tip]")
    return made_calibrated(robot, "joint_offset@2", "link_geometry@1", "link_geometry@2")


def test_nominal_pose_and_error_together_are_where_the_robot_is(calibrated):
    table = forward_table(calibrated, 100, HANGING, 1)
    assert len(table) == 128
    position, rotation = forward(calibrated, table[["q1", "q2", "q3"]].to_numpy(), HANGING)
    np.testing.assert_allclose(table[["x", "y", "z"]].to_numpy() + table[["dx", "dy", "dz"]].to_numpy(), position, atol=1e-12)
    names = ["drx", "dry", "drz"], ["rx", "ry", "rz"]
    turn, nominal = (Rotation.from_rotvec(table[each].to_numpy().copy()) for each in names)
    np.testing.assert_allclose((turn * nominal).as_matrix(), rotation, atol=1e-12)


def test_interpolation_leaves_less_the_more_rows_there_are(calibrated):
    few, many = (interpolation_error_m(calibrated, forward_table(calibrated, n, HANGING, 1), HANGING, 2) for n in (64, 4096))
    assert few[1] == many[1] > few[0] > 5 * many[0]
