"""Where a pull acts, and where a bias is."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from synthetic import candidate_on, conditions_on, displacements, made_states

from elastocal.effects.load import lever_of_pull

PLACE = np.array([0.1, -0.4, 0.25])


@pytest.mark.parametrize("share", [0.0, 0.005, 0.05])
def test_moments_that_are_a_hundredth_off_still_have_a_place_that_turns_with_the_flange_and_others_have_none(share):
    """Forces anywhere with the flange anywhere."""
    rng = np.random.default_rng(0)
    force, rotation = 300.0 * rng.standard_normal((8, 3)), Rotation.random(8, rng=rng).as_matrix()
    moment, noise = np.cross(rotation @ PLACE, force), rng.standard_normal((8, 3))
    moment = moment + share * noise * np.linalg.norm(moment) / np.linalg.norm(noise)
    lever = lever_of_pull(np.concatenate([force, moment], axis=1), rotation)
    np.testing.assert_allclose(lever, 0 * force if share > 0.01 else rotation @ PLACE, atol=4 * share + 1e-9)


def test_a_bias_is_there_wherever_something_is_recorded_be_it_a_moment_alone(fanuc):
    states = made_states(6, 3, seed=4)
    states.wrench[:] = [[300.0, 20.0, 10.0, 1.0, 2.0, 3.0], [0, 0, 0, 0, 5.0, 0], [0] * 6]
    around = conditions_on(fanuc.chain, states)
    made = displacements(candidate_on(fanuc.chain, "force_bias[base axes]"), around)[..., :6]
    for direction, turned in zip(np.eye(6)[:3], made, strict=True):
        np.testing.assert_allclose(
            turned, around.joint_deflections(np.array([direction, direction, 0 * direction])), rtol=1e-12
        )
