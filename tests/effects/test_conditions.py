"""How far a campaign had come in each state."""

from dataclasses import replace

import numpy as np
from synthetic import made_states

from elastocal.effects.conditions import progress_of


def test_progress_counts_rows_of_the_campaign_or_else_poses():
    states = made_states(6, 5, seed=16)
    np.testing.assert_allclose(progress_of(states), np.arange(5) / 4)
    # Some of the rows of a longer campaign.
    np.testing.assert_allclose(progress_of(states, (1, 21)), np.arange(5) / 20)
    without = replace(states, row=None)
    np.testing.assert_allclose(progress_of(without), np.arange(5) / 4)
    # What is to be measured comes after all rows.
    np.testing.assert_array_equal(progress_of(without, (1, 21)), np.ones(5))
