"""Laws that the catalogue does not have."""

from dataclasses import replace

import numpy as np
import pytest

from elastocal_proof.plant.campaigns import Design, schedule_of
from elastocal_proof.plant.defects import Defect, with_defects
from elastocal_proof.plant.kinds import OUTSIDE


@pytest.fixture(scope="module")
def done(fanuc_arm):
    return schedule_of(fanuc_arm, Design(poses=100, approach_each_load=False), 3)


def bad(robot, kind, joints, size, seed=1):
    return with_defects(robot, [Defect(OUTSIDE + kind, joints, size, seed)])


def gear(robot, done, joint, *torques):
    torque = np.zeros((len(done.pose), 6))
    for at, value in torques:
        torque[:, at] = value
    (where, law) = robot.gears[-1]
    assert where == joint
    return law(done, torque, torque)


def test_a_cable_pulls_by_the_product_of_two_angles(weightless, done):
    (joint, law) = bad(weightless, "cable_pull", (4,), 2e-4).drives[-1]
    assert joint == 3
    np.testing.assert_allclose(np.abs(law(done)), np.abs(2e-4 * done.angle[:, 2] * done.angle[:, 3]))


def test_a_slipping_zero_walks_at_some_moves_and_stands_between_them(weightless, done):
    walk = bad(weightless, "slipping_zero", (1,), 1e-4).drives[-1][1](done)
    first = np.unique(done.approach, return_index=True)[1]
    np.testing.assert_array_equal(walk, walk[first][done.approach])
    slips = np.diff(walk[first])
    assert 0.15 < (slips != 0).mean() < 0.45 and np.std(slips[slips != 0]) == pytest.approx(1e-4, rel=0.4)
    other = bad(weightless, "slipping_zero", (1,), 1e-4).drives[-1][1](replace(done, seed=4))
    assert (walk != other).any()


def test_a_cable_yields_as_its_free_length_and_to_the_tension_of_the_joint_behind(weightless, done):
    robot = bad(weightless, "cable_transmission", (3,), 1e-6)
    own = gear(robot, done, 2, (2, 100.0)) / 1e-4 - 1.0
    winding = own / (done.angle[:, 2] / np.pi)
    assert np.ptp(winding) < 1e-9 and 0.4 <= abs(winding[0]) <= 0.8
    np.testing.assert_allclose(gear(robot, done, 2, (3, 100.0)), 5e-5)


def test_an_asymmetric_gear_turns_alike_for_both_signs(weightless, done):
    robot = bad(weightless, "asymmetric_gear", (2,), 1e-10)
    up, down = (gear(robot, done, 1, (1, torque)) for torque in (1000.0, -1000.0))
    np.testing.assert_allclose(np.abs(up), 1e-4)
    np.testing.assert_array_equal(up, down)


def test_a_gear_softens_with_the_warmth_of_the_castings(weightless, done):
    found = gear(bad(weightless, "warm_softening", (2,), 0.01), done, 1, (1, 100.0))
    warm = weightless.warmth.of_castings(done.time_s)
    np.testing.assert_allclose(found, 0.01 * weightless.compliance[1] * 100.0 * warm)


def test_a_foot_slips_by_its_clearance_once_friction_is_overcome_and_no_further(weightless):
    slip = dict(bad(weightless, "foot_slip", (), 8e-5).structure_laws)["base_x"]
    np.testing.assert_allclose(slip(np.array([0.0, 90.0, -90.0, 1e4, -1e4])), [0.0, 0.0, 0.0, 8e-5, -8e-5])


def test_a_bolted_link_opens_with_the_cube_of_its_moment_in_all_its_pieces(weightless):
    laws = bad(weightless, "stiffening_link", (2,), 1e-13).structure_laws
    assert {name for name, _ in laws} == {f"link2_{piece}_bend" for piece in range(6)}
    assert sum(law(np.array([1000.0])) for _, law in laws) == pytest.approx(1e-4)
