"""Observations: what is averaged with what, in which order, and with which rotations."""

from dataclasses import fields, replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from elastocal.campaigns.campaign import Measurements
from elastocal.fitting.observations import (
    averaged,
    each_approach,
    groups_by_size,
    select_states,
    state_clusters,
    without_outlying_repeats,
)


def measurements(keys, position=None, **others):
    """Measurements from rows of (session, pose, load, repeat, target)."""
    session, pose, load, repeat, target = np.array(keys).T
    count = len(pose)
    rng = np.random.default_rng(0)
    given_values = {
        "joint_angles": rng.standard_normal((count, 2)),
        "wrench": rng.standard_normal((count, 6)),
        "position": rng.standard_normal((count, 3)) if position is None else np.array(position, float),
        "rotation_vector": None,
        "approach": None,
        "time_s": None,
        "temperature_c": None,
    }
    return Measurements(session, pose, load, repeat, target, **{**given_values, **others}, row=np.arange(1, count + 1))


FOUR = [(0, 0, 0, 0, 0), (0, 0, 0, 1, 0), (0, 1, 0, 0, 0), (0, 1, 0, 1, 0)]


def test_repeats_of_a_pose_are_averaged():
    found = averaged(measurements(FOUR, [[0, 0, 0], [2, 4, 6], [5, 5, 5], [7, 5, 3]]))
    np.testing.assert_array_equal(found.position, [[1, 2, 3], [6, 5, 4]])
    np.testing.assert_array_equal(found.states.repeats, [2, 2])
    assert found.rotation is None and found.rows == 3


def test_sessions_poses_loads_and_targets_are_kept_apart():
    keys = [(s, p, load, r, t) for s in (0, 3) for p in (2, 7) for load in (0, 1) for r in (0, 1, 2) for t in (0, 1)]
    found = averaged(measurements(keys))
    assert len(found) == 16 and len(found.states) == 8
    expected = sorted({key[:3] for key in keys})
    assert list(zip(found.states.session, found.states.pose, found.states.load, strict=True)) == expected
    np.testing.assert_array_equal(found.state, np.repeat(np.arange(8), 2))
    np.testing.assert_array_equal(found.target, np.tile([0, 1], 8))
    np.testing.assert_array_equal(found.states.repeats, 3)


def test_cluster_is_the_pose_with_all_its_loads_in_its_session():
    keys = [(s, p, load, 0, t) for s in (0, 1) for p in (4, 9) for load in (0, 1) for t in (0, 1)]
    found = averaged(measurements(keys))
    np.testing.assert_array_equal(state_clusters(found.states), [0, 0, 1, 1, 2, 2, 3, 3])
    np.testing.assert_array_equal(found.cluster, np.repeat([0, 1, 2, 3], 4))


def test_approaches_from_different_sides_are_different_states():
    approach = np.array([[1.0, 1.0], [-1.0, 1.0], [1.0, 1.0], [1.0, 1.0]])
    found = averaged(measurements(FOUR, [[0, 0, 0], [2, 4, 6], [5, 5, 5], [7, 5, 3]], approach=approach))
    np.testing.assert_array_equal(found.states.approach, [[-1, 1], [1, 1], [1, 1]])
    np.testing.assert_array_equal(found.position, [[2, 4, 6], [0, 0, 0], [6, 5, 4]])
    np.testing.assert_array_equal(found.states.repeats, [1, 1, 2])
    np.testing.assert_array_equal(found.cluster, [0, 0, 1])


def test_state_counts_the_repeats_of_the_target_seen_least_often():
    keys = [(0, 0, 0, 0, 0), (0, 0, 0, 1, 0), (0, 0, 0, 2, 0), (0, 0, 0, 0, 1)]
    found = averaged(measurements(keys))
    np.testing.assert_array_equal(found.states.repeats, [1])


def test_mean_rotation_is_that_of_scipy():
    rng = np.random.default_rng(1)
    centre = Rotation.random(2, rng=rng)
    # Near half a turn a mean of rotation vectors would be far off.
    centre = Rotation.concatenate([centre[0], Rotation.from_rotvec([np.pi, 0, 0])])
    keys = [(0, p, 0, r, 0) for p in (0, 1) for r in range(5)]
    turned = Rotation.from_rotvec(1e-4 * rng.standard_normal((10, 3))) * centre[np.repeat([0, 1], 5)]
    found = averaged(measurements(keys, rotation_vector=turned.as_rotvec()))
    assert found.rows == 6
    for pose in (0, 1):
        expected = turned[5 * pose : 5 * pose + 5].mean().as_matrix()
        # The two means differ in third order of 1e-4 rad.
        np.testing.assert_allclose(found.rotation[pose], expected, rtol=0, atol=1e-11)


def test_each_approach_is_a_state_and_knows_the_averaged_one():
    keys = [(0, p, load, r, t) for p in (0, 1) for load in (0, 1) for r in (0, 1, 2) for t in (0, 1)]
    taken = measurements(keys)
    found, repeated = each_approach(taken)
    together = averaged(taken)
    assert len(found.states) == 12 and len(found) == 24
    np.testing.assert_array_equal(repeated, np.repeat(np.arange(4), 3))
    np.testing.assert_array_equal(found.states.pose, together.states.pose[repeated])
    np.testing.assert_array_equal(found.states.load, together.states.load[repeated])
    np.testing.assert_array_equal(found.states.repeats, 1)
    for state in range(4):
        for target in (0, 1):
            mean = found.position[(repeated[found.state] == state) & (found.target == target)].mean(axis=0)
            np.testing.assert_allclose(together.position[(together.state == state) & (together.target == target)][0], mean)


def full_measurements(seed, loads=2):
    rng = np.random.default_rng(seed)
    keys = [(s, p, load, r, t) for s in (0, 1) for p in range(3) for load in range(loads) for r in (0, 1) for t in (0, 1)]
    count = len(keys)
    pose_of = np.array([3 * s + p for s, p, *_ in keys])
    turned = Rotation.from_rotvec(1e-4 * rng.standard_normal((count, 3))) * Rotation.random(6, rng=rng)[pose_of]
    approach = rng.choice([-1.0, 1.0], (6, 2))[pose_of]
    return measurements(
        keys,
        rng.standard_normal((count, 3)),
        rotation_vector=turned.as_rotvec(),
        approach=approach,
        time_s=rng.uniform(0, 9, count),
        temperature_c=rng.uniform(20, 30, count),
    )


@given(st.integers(0, 2**32 - 1))
def test_order_of_the_rows_does_not_matter(seed):
    taken = full_measurements(0)
    kept = np.random.default_rng(seed).permutation(len(taken))[: len(taken) - 3]
    one, other = averaged(taken.select(np.sort(kept))), averaged(taken.select(kept))
    for name, value in vars(one.states).items():
        np.testing.assert_allclose(value, getattr(other.states, name), rtol=0, atol=1e-14)
    for name in ("state", "target", "position", "rotation"):
        # Rotations 1e-4 rad apart, averaged about another of them: 1e-12.
        np.testing.assert_allclose(getattr(one, name), getattr(other, name), rtol=0, atol=1e-11)


@given(st.lists(st.booleans(), min_size=12, max_size=12).filter(any))
def test_selected_states_are_those_of_the_selected_measurements(kept):
    taken, kept = full_measurements(0), np.array(kept)
    whole = averaged(taken)
    chosen = {
        key
        for key, k in zip(zip(whole.states.session, whole.states.pose, whole.states.load, strict=True), kept, strict=True)
        if k
    }
    mask = np.array([key in chosen for key in zip(taken.session, taken.pose, taken.load, strict=True)])
    expected, found = averaged(taken.select(mask)), select_states(whole, kept)
    for field in fields(expected.states):
        np.testing.assert_allclose(getattr(found.states, field.name), getattr(expected.states, field.name), atol=1e-14)
    for name in ("state", "target", "position", "rotation"):
        np.testing.assert_allclose(getattr(found, name), getattr(expected, name), atol=1e-14)


def repeated(repeats, poses=30, seed=0, targets=2, single=0):
    """Measurements with unit noise of poses with so many repeats, and of further ones without."""
    keys = [(0, p, 0, r, t) for p in range(poses + single) for r in range(repeats if p < poses else 1) for t in range(targets)]
    rng = np.random.default_rng((1, seed))
    place = 1e4 * rng.standard_normal((poses + single, targets, 3))
    at = np.array([place[p, t] for _, p, _, _, t in keys])
    return measurements(keys, at + rng.standard_normal(at.shape))


def rows_lost(taken):
    return sorted(set(taken.row) - set(without_outlying_repeats(taken).row))


@pytest.mark.parametrize("repeats", [3, 4, 5])
@pytest.mark.parametrize("off", [[30.0, 0, 0], [0, -30.0, 0], [0, 0, 30.0]])
def test_a_wild_repeat_leaves_and_all_others_stay(repeats, off):
    taken = repeated(repeats, seed=1, single=5)
    for outlying in (0, 7, 30 * repeats):
        moved = taken.position.copy()
        moved[outlying] += off
        assert rows_lost(replace(taken, position=moved)) == [outlying + 1]


@pytest.mark.parametrize("repeats", [3, 4, 5, 6, 9])
def test_clean_noise_loses_nothing(repeats):
    """Of 3,600 poses: a rate of 1 in 1,000 is seen with a power of 0.97."""
    assert sum(len(rows_lost(repeated(repeats, poses=60, seed=seed))) for seed in range(60)) == 0


@pytest.mark.parametrize("group", [[0, 0, 1, 3, 3, 4], [3, 0, 4, 3, 0, 1]], ids=["rising", "in any order"])
def test_groups_of_one_size_stand_together_with_their_places_rising(group):
    group = np.array(group)
    single, pairs = groups_by_size(group)
    np.testing.assert_array_equal(group[single], [[1], [4]])
    np.testing.assert_array_equal(group[pairs], [[0, 0], [3, 3]])
    assert (np.diff(pairs, axis=1) > 0).all()
    assert sorted([*single.ravel(), *pairs.ravel()]) == list(range(6))
