"""Laws that the catalogue does not have; that none changes is in `test_catalogued`."""

from dataclasses import replace

import numpy as np
import pytest

from elastocal_proof.plant.campaigns import Design, schedule_of
from elastocal_proof.plant.kinds import OUTSIDE, Defect, with_defects


@pytest.fixture(scope="module")
def done(fanuc_arm):
    return schedule_of(fanuc_arm, Design(poses=100, approach_each_load=False), 3)


def bad(robot, kind, joints, size, seed=1):
    return with_defects(robot, [Defect(OUTSIDE + kind, joints, size, seed)])


def test_errors_of_two_angles_are_of_both(weightless, done):
    (joint, law) = bad(weightless, "cable_pull", (4,), 2e-4).drives[-1]
    assert joint == 3
    np.testing.assert_allclose(np.abs(law(done)), np.abs(2e-4 * done.angle[:, 2] * done.angle[:, 3]))
    (joint, law) = bad(weightless, "two_angles", (4,), 2e-4).drives[-1]
    # Along one of the two diagonals of the plane of both angles it is constant, along the other and along each axis it is not.
    moved = [done.angle + 0.3 * np.eye(6)[3] + sense * 0.3 * np.eye(6)[4] for sense in (1, -1, 0)]
    change = sorted(np.abs(law(replace(done, angle=angle)) - law(done)).max() for angle in moved)
    assert joint == 3 and change[0] < 1e-12 < 2e-5 < change[1] and np.abs(law(done)).max() <= 2e-4


def test_a_slipping_zero_walks_at_some_moves_and_stands_between_them(weightless, done):
    walk = bad(weightless, "slipping_zero", (1,), 1e-4).drives[-1][1](done)
    first = np.unique(done.approach, return_index=True)[1]
    np.testing.assert_array_equal(walk, walk[first][done.approach])
    slips = np.diff(walk[first])
    assert 0.15 < (slips != 0).mean() < 0.45 and np.std(slips[slips != 0]) == pytest.approx(1e-4, rel=0.4)


def test_a_foot_slips_by_its_clearance_once_friction_is_overcome_and_no_further(weightless):
    slip = dict(bad(weightless, "foot_slip", (), 8e-5).structure_laws)["base_x"]
    np.testing.assert_allclose(slip(np.array([0.0, 90.0, -90.0, 1e4, -1e4])), [0.0, 0.0, 0.0, 8e-5, -8e-5])
