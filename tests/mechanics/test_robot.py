"""A robot: its angles as the controller reports them, and targets on all of its
points."""

from dataclasses import replace

import numpy as np
import pytest
from support import robot_of

from elastocal.io.documents import read_document
from elastocal.mechanics.robot import estimate_typical_compliance
from elastocal.mechanics.robot_file import parse_robot


def test_reported_angles_are_converted_both_ways():
    matrix = np.array([[1.0, 0.0], [1.0, -1.0]])
    offset = np.radians([90.0, -45.0])
    robot = replace(
        robot_of("Rz(q1) Tx(1) Ry(q2) [A]"),
        reported_matrix=matrix,
        reported_offset=offset,
    )
    reported = np.radians([[10.0, 20.0], [-30.0, 5.0], [0.0, 0.0]])
    angles = np.radians([[100.0, -55.0], [60.0, -80.0], [90.0, -45.0]])
    np.testing.assert_allclose(robot.model_angles(reported), angles, rtol=1e-12)
    np.testing.assert_allclose(robot.reported_angles(angles), reported, atol=1e-12)
    np.testing.assert_allclose(robot.model_angles(reported[0]), angles[0], rtol=1e-12)


@pytest.mark.parametrize("name", ["kuka", "fanuc", "fanuc_measured"])
def test_published_compliances_are_within_a_factor_of_five_of_typical_ones(
    name, config_folder
):
    robot = parse_robot(read_document(config_folder / "robots" / f"{name}.yaml"))
    ratio = robot.compliance / estimate_typical_compliance(
        robot.chain, robot.payload_kg
    )
    assert (np.maximum(ratio, 1 / ratio) < 5).all()
