"""Motion of a chain: Jacobians and forces of one walk against those of each point by itself."""

from dataclasses import replace

import numpy as np
import pytest
from support import ODD_CHAINS, OTHER_CHAINS, random_angles

from elastocal.mechanics.kinematics import poses_and_jacobians
from elastocal.mechanics.motion import motion

# Metres and radians of order one through a dozen products: some tens of roundings of 1e-16.
ROUNDING = 2e-14


@pytest.mark.parametrize("name", ["kuka", *OTHER_CHAINS, *ODD_CHAINS])
def test_motion_gives_the_jacobian_of_every_point_and_the_forces_of_every_wrench(name, chain_called):
    chain = chain_called(name)
    rng = np.random.default_rng(31)
    angles, wrench = random_angles(rng, chain, 7), rng.standard_normal((7, 6))
    points = [replace(point, offset_m=(0.1, -0.2, 0.3)) for point in chain.points]
    moved = motion(chain, angles, points)
    for number, point in enumerate(points):
        position, rotation, jacobian = poses_and_jacobians(chain, angles, point)
        np.testing.assert_allclose(moved.position[number].T, position, rtol=0, atol=ROUNDING)
        np.testing.assert_allclose(np.moveaxis(moved.rotation[number], -1, 0), rotation, rtol=0, atol=ROUNDING)
        found = moved.jacobian(point.after, moved.position[number])
        np.testing.assert_allclose(np.moveaxis(found, -1, 0), jacobian, rtol=0, atol=ROUNDING)
        some = moved.jacobian(point.after, moved.position[number][:, [4, 1, 1]], 3, np.array([4, 1, 1]))
        np.testing.assert_allclose(np.moveaxis(some, -1, 0), jacobian[[4, 1, 1], :3], rtol=0, atol=ROUNDING)
        moment = wrench[:, 3:] + np.cross(position, wrench[:, :3])
        forces = moved.generalized_forces(point.after, wrench[:, :3].T, moment.T)
        np.testing.assert_allclose(forces.T, np.einsum("sij,si->sj", jacobian, wrench), rtol=0, atol=10 * ROUNDING)
