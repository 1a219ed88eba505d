"""Components of displacements and wrenches, as all tables have them."""

import numpy as np
from support import PinocchioPoint, chain_of

from elastocal.mechanics.components import COMPONENT_NAMES, COMPONENTS, WRENCH
from elastocal.mechanics.kinematics import poses_and_jacobians


def test_a_force_and_the_displacement_that_it_works_along_stand_at_the_same_place():
    for (moved, unit, moves), (load, load_unit, loads) in zip(COMPONENTS, WRENCH, strict=True):
        assert (moved[0], load[0], unit, load_unit) in [("d", "f", "m", "N"), ("r", "m", "rad", "N m")]
        assert moved[1] == load[1] == moves[-1] == loads[-1]


def test_rows_of_a_jacobian_are_these_components_as_in_pinocchio():
    chain = chain_of("Tz(0.5) Rz(q1) Tx(2) [hand]")
    found = poses_and_jacobians(chain, np.zeros((1, 1)), chain.end_effector)[2][0, :, 0]
    assert {name: value for name, value in zip(COMPONENT_NAMES, found, strict=True) if value} == {"dy": 2.0, "rz": 1.0}
    np.testing.assert_allclose(found, PinocchioPoint(chain, chain.end_effector).pose_and_jacobian([0.0])[2][:, 0], atol=1e-15)
