"""Robots of the public sources, beside the Denavit-Hartenberg tables that their makers or the sources state."""

import numpy as np
import pytest
from support import homogeneous

from elastocal.campaigns.reading import read_robot
from elastocal.mechanics.kinematics import poses

# Rows of offset of theta (deg), d, a (m), alpha (deg). The turntable of the Motoman stands still.
TABLES = {
    "ur5": [
        *((0, 0.089159, 0.0, 90), (0, 0.0, -0.425, 0), (0, 0.0, -0.39225, 0)),
        *((0, 0.10915, 0.0, 90), (0, 0.09465, 0.0, -90), (0, 0.0823, 0.0, 0)),
    ],
    "ur10": [
        *((0, 0.1273, 0.0, 90), (0, 0.0, -0.612, 0), (0, 0.0, -0.5723, 0)),
        *((0, 0.163941, 0.0, 90), (0, 0.1157, 0.0, -90), (0, 0.0922, 0.0, 0)),
    ],
    "wam": [
        *((0, 0.0, 0.0, -90), (0, 0.0, 0.0, 90), (0, 0.55, 0.045, -90), (0, 0.0, -0.045, 90)),
        *((0, 0.3, 0.0, -90), (0, 0.0, 0.0, 90), (0, 0.06, 0.0, 0)),
    ],
    "motoman_right_arm": [
        *((-90, -0.263, 0.0, 15), (0, 1.4159, 0.15, -90), (-90, 0.0, 0.614, 180), (0, 0.0, 0.2, -90)),
        *((0, -0.64, 0.0, 90), (-90, 0.0, 0.03, 90), (0, 0.2, 0.0, 0)),
    ],
}


@pytest.mark.parametrize("name", TABLES)
def test_the_chain_is_that_of_the_table(config_folder, name):
    robot, rows = read_robot(config_folder / "robots" / f"{name}.yaml"), TABLES[name]
    for angles in np.random.default_rng(7).uniform(-np.pi, np.pi, (5, robot.joints)):
        expected = np.eye(4)
        for angle, (offset, d, a, alpha) in zip([0.0, *angles][-len(rows) :], rows, strict=True):
            expected = expected @ homogeneous("R", 2, angle + np.radians(offset)) @ homogeneous("T", 2, d)
            expected = expected @ homogeneous("T", 0, a) @ homogeneous("R", 0, np.radians(alpha))
        position, rotation = poses(robot.chain, angles[None], robot.chain.end_effector)
        np.testing.assert_allclose(position[0], expected[:3, 3], rtol=0, atol=1e-14)
        np.testing.assert_allclose(rotation[0], expected[:3, :3], rtol=0, atol=1e-14)
