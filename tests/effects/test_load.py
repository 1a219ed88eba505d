"""Where a pull acts, and where a bias is."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from synthetic import candidate_on, conditions_on, displacements, made_states

from elastocal.effects.load import lever_of_pull

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


def test_a_bias_is_there_wherever_something_is_recorded_be_it_a_moment_alone(fanuc):
    states = made_states(6, 3, seed=4)
    states.wrench[:] = [[300.0, 20.0, 10.0, 1.0, 2.0, 3.0], [0, 0, 0, 0, 5.0, 0], [0] * 6]
    around = conditions_on(fanuc.chain, states)
    made = displacements(candidate_on(fanuc.chain, "force_bias[base axes]"), around)[..., :6]
    for direction, turned in zip(np.eye(6)[:3], made, strict=True):
        np.testing.assert_allclose(
            turned, around.joint_deflections(np.array([direction, direction, 0 * direction])), rtol=1e-12
        )
