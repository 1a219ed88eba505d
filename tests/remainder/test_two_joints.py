"""Functions of two joints' angles: the pair is found, and what it does is predicted."""

import numpy as np
import pytest
from made_remainders import NOISE_M, made_inputs

from elastocal.remainder import two_joints


@pytest.mark.parametrize("pair", [(0, 2), (1, 3)])
def test_a_deviation_by_two_angles_is_found_among_all_pairs_and_noise_is_not_followed(pair):
    (inputs, _), (there, _) = made_inputs(120, seed=1, joints=4), made_inputs(60, seed=2, joints=4)

    def off(some):
        one, other = some.joint_angles[:, pair].T
        return 3e-4 * some.jacobian[:, :, 1] * (np.sin(one + 0.3) * np.sin(other - 1.0))[:, None]

    noise = np.random.default_rng(3).normal(0.0, NOISE_M, (120, 3))
    found = next(two_joints.fitted(inputs, off(inputs) + noise, two_joints.SETTINGS, 1))(there).mean
    assert np.sqrt(((found - off(there)) ** 2).mean()) < 0.7 * NOISE_M
    nothing = next(two_joints.fitted(inputs, noise, two_joints.SETTINGS, 1))(there).mean
    assert np.sqrt((nothing**2).mean()) < 0.7 * NOISE_M
