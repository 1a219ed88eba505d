"""Where a pull acts, and what a wrong force is per unit of its error."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from elastocal.effects.load import lever_of_pull, pushed, shifted, turned

PLACE = np.array([0.1, -0.4, 0.25])


@pytest.fixture
def pulls():
    """Forces anywhere with the flange anywhere."""
    rng = np.random.default_rng(0)
    return rng.standard_normal((8, 3)) * [[300.0]], Rotation.random(8, rng=rng).as_matrix()


def wrench_of(force, lever):
    return np.concatenate([force, np.cross(lever, force)], axis=1)


def test_a_place_that_turns_with_the_flange_is_found_from_the_moments(pulls):
    force, rotation = pulls
    lever = rotation @ PLACE
    np.testing.assert_allclose(lever_of_pull(wrench_of(force, lever), rotation), lever, rtol=1e-9)


def test_moments_that_are_a_hundredth_off_still_have_a_place_and_others_have_none(pulls):
    force, rotation = pulls
    wrench, rng = wrench_of(force, rotation @ PLACE), np.random.default_rng(1)
    noise = rng.standard_normal((8, 3))
    noise *= np.linalg.norm(wrench[:, 3:]) / np.linalg.norm(noise)
    for share, found in ((0.005, True), (0.05, False)):
        lever = lever_of_pull(wrench + np.concatenate([np.zeros((8, 3)), share * noise], axis=1), rotation)
        assert lever.any() == found
        if found:
            np.testing.assert_allclose(lever, rotation @ PLACE, atol=0.02)


def test_changes_of_a_wrench_are_those_of_a_unit_by_hand():
    """About z: a force along x turns to y; a shift along z of a force along x makes a moment about y."""
    wrench = np.array([[5.0, 0.0, 0.0, 7.0, 8.0, 9.0], [0.0] * 6])
    axis = np.tile([0.0, 0.0, 1.0], (2, 1))
    np.testing.assert_array_equal(turned(axis, wrench), [[0, 5, 0, 0, 0, 0], [0] * 6])
    np.testing.assert_array_equal(shifted(axis, wrench), [[0, 0, 0, 0, 5, 0], [0] * 6])
    # A push is there wherever something is recorded, be it a moment alone.
    np.testing.assert_array_equal(pushed(axis, wrench), [[0, 0, 1, 0, 0, 0], [0] * 6])
    np.testing.assert_array_equal(pushed(axis, wrench[:, [1, 2, 1, 4, 1, 1]])[0], [0, 0, 1, 0, 0, 0])
