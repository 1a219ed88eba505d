"""The needs of effects that states meet, and the progress of a campaign."""

from dataclasses import replace

import numpy as np
import pytest
from synthetic import make_states

from elastocal.effects.conditions import compute_progress, find_offered_needs
from elastocal.mechanics.sites import build_sites


def test_progress_counts_rows_of_the_campaign_or_poses():
    states = make_states(6, 5, seed=16)
    np.testing.assert_allclose(compute_progress(states), np.arange(5) / 4)
    # The states are the first rows of a longer campaign.
    np.testing.assert_allclose(compute_progress(states, (1, 21)), np.arange(5) / 20)
    without_rows = replace(states, row=None)
    np.testing.assert_allclose(compute_progress(without_rows), np.arange(5) / 4)
    # Measurements that are still planned come after all rows.
    np.testing.assert_array_equal(compute_progress(without_rows, (1, 21)), np.ones(5))


@pytest.mark.parametrize(
    ("column", "name"), [("time_s", "time"), ("temperature_c", "temperature")]
)
def test_time_and_temperature_are_offered_if_they_change(kuka, column, name):
    sites = build_sites(kuka)
    states = make_states(6, 5, seed=1)
    assert name in find_offered_needs(
        sites, replace(states, **{column: np.arange(5.0)})
    )
    assert name not in find_offered_needs(
        sites, replace(states, **{column: np.full(5, 20.0)})
    )
    assert name not in find_offered_needs(sites, replace(states, **{column: None}))


def test_the_order_of_the_rows_is_offered_only_without_times(kuka):
    sites = build_sites(kuka)
    states = replace(make_states(6, 5, seed=1), time_s=None)
    assert "order" in find_offered_needs(sites, states)
    timed = replace(states, time_s=np.arange(5.0))
    assert "order" not in find_offered_needs(sites, timed)
    single = replace(states, row=np.ones(5, int))
    assert "order" not in find_offered_needs(sites, single)
