"""A robot with its instruments: its gears and weights, its warmth, and what a tracker without noise reads."""

from dataclasses import replace

import numpy as np

from elastocal.plant.campaigns import schedule_of
from elastocal.plant.physical_robot import Warmth, seen_poses
from elastocal.plant.tracker import rotation_vector


def test_castings_warm_up_behind_the_thermometer_and_reach_it():
    warmth, time = Warmth(10.0, 3000.0, 1200.0), np.linspace(0, 40000, 400)
    shown, castings = warmth.shown(time), warmth.of_castings(time)
    assert (castings[1:] < shown[1:]).all()
    assert castings[0] == shown[0] == 20.0
    np.testing.assert_allclose([shown[-1], castings[-1]], 30.0, atol=1e-3)
    # T_lag dT/dt = shown - castings.
    slope = np.gradient(castings, time)
    np.testing.assert_allclose(1200.0 * slope[5:-5], (shown - castings)[5:-5], atol=0.02)


def test_links_grow_in_proportion_to_their_castings_warmth(weightless, small):
    schedule = schedule_of(weightless.arm, small, 2)
    grown = seen_poses(replace(weightless, expansion_per_K=1e-5), schedule)
    nominal = seen_poses(weightless, schedule)
    unloaded = schedule.load == 0
    share = 1e-5 * (weightless.warmth.of_castings(schedule.time_s) - 20.0)
    np.testing.assert_allclose(grown[0][unloaded], (nominal[0] * (1 + share)[:, None, None])[unloaded], atol=1e-12)
    assert np.abs(rotation_vector(grown[1] @ np.swapaxes(nominal[1], -1, -2))[unloaded]).max() < 1e-12
