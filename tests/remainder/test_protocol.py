"""Inputs of a regression belong together."""

import numpy as np
from made_remainders import made_inputs


def test_inputs_are_selected_together_and_angles_come_first():
    inputs, _ = made_inputs(7, seed=1)
    some = inputs.select(np.array([4, 2]))
    assert len(some) == 2
    np.testing.assert_array_equal(some.columns[:, :2], inputs.joint_angles[[4, 2]])
    np.testing.assert_array_equal(some.columns[:, 2:], inputs.others[[4, 2]])
    np.testing.assert_array_equal(some.jacobian, inputs.jacobian[[4, 2]])
