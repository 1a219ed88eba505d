"""Trees follow what is not smooth."""

import numpy as np
from made_remainders import made_inputs

from elastocal.remainder import extra_trees


def test_a_step_is_followed_and_a_seed_repeats_itself():
    inputs, _ = made_inputs(300, seed=1)
    there, _ = made_inputs(300, seed=2)

    def step(some):
        return 1e-3 * np.repeat(np.sign(some.joint_angles[:, :1]), 3, axis=1)

    setting = [extra_trees.SETTINGS[0]]
    first, second = (next(iter(extra_trees.fitted(inputs, step(inputs), setting, 1)))(there) for _ in range(2))
    np.testing.assert_array_equal(first.mean, second.mean)
    assert first.std is None
    assert np.sqrt(((first.mean - step(there)) ** 2).mean()) < 3e-4
