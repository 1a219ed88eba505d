"""A robot with its instruments: its gears and weights, its warmth, and what a tracker without noise reads."""

from dataclasses import replace

import numpy as np
import pytest

from elastocal_proof.plant.arm import rotation_vector
from elastocal_proof.plant.campaigns import Design, schedule_of
from elastocal_proof.plant.machine import machine_of
from elastocal_proof.plant.physical_robot import Warmth, driven, seen_poses, specimen


def test_castings_warm_up_behind_the_thermometer_and_reach_it():
    warmth, time = Warmth(10.0, 3000.0, 1200.0), np.linspace(0, 40000, 400)
    shown, castings = warmth.shown(time), 20.0 + warmth.of_castings(time)
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
    share = 1e-5 * weightless.warmth.of_castings(schedule.time_s)
    np.testing.assert_allclose(grown[0][unloaded], (nominal[0] * (1 + share)[:, None, None])[unloaded], atol=1e-12)
    assert np.abs(rotation_vector(grown[1] @ np.swapaxes(nominal[1], -1, -2))[unloaded]).max() < 1e-12


def test_gears_of_a_series_differ_by_no_more_than_their_spread_and_each_by_its_own(fanuc_arm):
    shares = np.array([specimen(fanuc_arm, seed, 0.1, weighs=False).compliance for seed in range(200)]) / fanuc_arm.compliance
    assert (np.abs(shares - 1.0) <= 0.1).all()
    # Even over the spread: 200 draws miss an end by a tenth of the range in one of 1e9 cases, a mean by four standard errors.
    assert (np.ptp(shares, axis=0) > 0.18).all()
    np.testing.assert_allclose(shares.mean(axis=0), 1.0, atol=4 * 0.1 / np.sqrt(3 * 200))
    assert np.abs(np.corrcoef(shares.T) - np.eye(6)).max() < 4 / np.sqrt(200)


def test_a_specimen_follows_from_its_seed_and_its_weights_change_no_gear(fanuc_arm):
    heavy, light, off = (specimen(fanuc_arm, 7, **more) for more in ({}, {"weighs": False}, {"off_line_m": 0.03}))
    np.testing.assert_array_equal(heavy.compliance, light.compliance)
    np.testing.assert_array_equal(heavy.compliance, off.compliance)
    assert heavy.structure == specimen(fanuc_arm, 7).structure != specimen(fanuc_arm, 8).structure
    assert light.structure.masses == ()
    assert [mass.mass_kg for mass in heavy.structure.masses] == [mass.mass_kg for mass in off.structure.masses]
    assert [mass.aside_m for mass in heavy.structure.masses] != [mass.aside_m for mass in off.structure.masses]


@pytest.mark.parametrize(("kind", "group"), [("repeatability_rad", "approach"), ("pose_rad", "pose")])
def test_chance_of_the_drives_is_drawn_afresh_for_each_approach_or_pose_by_the_seed(weightless, fanuc_arm, kind, group):
    done = schedule_of(fanuc_arm, Design(poses=60, approach_each_load=False), 2)
    robot, machine = (
        replace(weightless, **{kind: (2e-5, 0.0, 1e-5, 0.0, 0.0, 0.0)}),
        machine_of(fanuc_arm, weightless.structure),
    )
    error, again, other = (
        driven(robot, replace(done, seed=seed), machine)[0] - done.angle for seed in (done.seed, done.seed, done.seed + 1)
    )
    first = np.unique(getattr(done, group), return_index=True)[1]
    np.testing.assert_allclose(error, error[first][getattr(done, group)], atol=1e-15)
    np.testing.assert_array_equal(error, again)
    assert np.abs(error - other)[:, 0].min() > 0
    np.testing.assert_allclose(error[first].std(axis=0), [2e-5, 0.0, 1e-5, 0.0, 0.0, 0.0], rtol=0.35, atol=1e-15)
