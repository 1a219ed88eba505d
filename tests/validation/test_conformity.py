"""A machine passes, fails or is undecided by the predictive distribution of its error,
and a judgement needs poses that span enough."""

from dataclasses import replace

import numpy as np
import pytest
from planted import planted
from support import chain_of

from elastocal.validation.conformity import (
    FAIL,
    MIN_CONFIGURATIONS,
    MIN_ROTATION_RAD,
    MIN_TRAVEL_SHARE,
    PASS,
    UNDECIDED,
    count_configurations,
    decide_conformity,
    find_joint_ranges,
    list_shortfalls,
)


@pytest.mark.parametrize(
    ("tolerance", "expected"), [(1.3e-4, PASS), (0.7e-4, FAIL), (1e-4, UNDECIDED)]
)
def test_the_predictive_distribution_decides_about_conformity(tolerance, expected):
    rms = 1e-4 * (1.0 + 0.1 * np.random.default_rng(1).standard_normal(4000))
    decision = decide_conformity(rms, tolerance, 0.05)
    assert decision.decision == expected
    assert decision.limit_m == pytest.approx(1e-4 * (1.0 + 0.1 * 1.645), rel=0.01)
    assert decision.risk_above == pytest.approx((rms > tolerance).mean(), abs=1e-3)


@pytest.fixture(scope="module")
def states(kuka):
    return planted(kuka, {}, seed=7, poses=12).observations.states


def limit_rotation(states, joint, range_rad):
    """Return the states with one joint rotating over a range only."""
    angles = states.joint_angles.copy()
    angles[:, joint] = np.linspace(0.1, 0.1 + range_rad, len(angles))
    return replace(states, joint_angles=angles)


def test_loads_and_repeats_of_a_pose_are_one_configuration(states):
    assert count_configurations(states) == 12
    same_pose = np.tile(states.joint_angles[:1], (len(states), 1))
    assert count_configurations(replace(states, joint_angles=same_pose)) == 1


def test_fewer_configurations_than_a_judgement_needs_are_too_few(kuka, states):
    (sentence,) = list_shortfalls(MIN_CONFIGURATIONS - 1, states, kuka)
    assert sentence == "too few: 7 configurations, where at least 8 must judge"


@pytest.mark.parametrize(("share", "count"), [(0.9, 1), (1.1, 0)])
def test_a_joint_that_hardly_rotates_is_a_shortfall(kuka, states, share, count):
    limited = limit_rotation(states, 3, share * MIN_ROTATION_RAD)
    shortfalls = list_shortfalls(MIN_CONFIGURATIONS, limited, kuka)
    assert len(shortfalls) == count
    for sentence in shortfalls:
        assert "joint 4 moved by 26°, and 29° are needed" in sentence


@pytest.mark.parametrize(("share", "count"), [(0.9, 1), (1.1, 0)])
def test_a_rail_needs_a_share_of_its_travel(kuka, states, share, count):
    rails = chain_of("Tx(q1) Ty(q2) Tz(q3) [hand]")
    gantry = replace(kuka, chain=rails, joint_limits=np.array([[0.0, 4.0]] * 3))
    moved = replace(
        states,
        joint_angles=np.linspace(
            0.0, [[share * MIN_TRAVEL_SHARE * 4.0, 2.0, 2.0]], len(states)
        )[:, 0],
    )
    shortfalls = list_shortfalls(MIN_CONFIGURATIONS, moved, gantry)
    assert len(shortfalls) == count
    for sentence in shortfalls:
        assert "too close: joint 1 moved by 0.36 m, and 0.4 m are needed" in sentence


def test_over_the_required_rotation_a_sine_changes_by_at_most_half_its_amplitude():
    """It changes by less near its extremes."""
    angle = np.linspace(-np.pi, np.pi, 100_001)
    after = np.sin(angle + 0.5 * MIN_ROTATION_RAD)
    before = np.sin(angle - 0.5 * MIN_ROTATION_RAD)
    assert np.abs(after - before).max() == pytest.approx(0.5, abs=1e-6)


def test_joint_ranges_are_smallest_and_largest_angles_in_degrees(kuka, states):
    ranges = find_joint_ranges(states, kuka)
    assert {ends.unit for ends in ranges} == {"deg"}
    spans = [ends.high - ends.low for ends in ranges]
    np.testing.assert_allclose(
        spans, np.rad2deg(np.ptp(states.joint_angles, axis=0)), rtol=1e-12
    )
