"""Observations: what is averaged with what, in which order, and with which rotations."""

from dataclasses import fields, replace

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from elastocal.campaign import Readings
from elastocal.observations import averaged, each_approach, select_states, state_clusters


def readings(keys, position=None, **others):
    """Readings from rows of (session, pose, load, repeat, target)."""
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
    return Readings(session, pose, load, repeat, target, **{**given_values, **others}, row=np.arange(1, count + 1))


FOUR = [(0, 0, 0, 0, 0), (0, 0, 0, 1, 0), (0, 1, 0, 0, 0), (0, 1, 0, 1, 0)]


def test_repeats_of_a_pose_are_averaged():
    found = averaged(readings(FOUR, [[0, 0, 0], [2, 4, 6], [5, 5, 5], [7, 5, 3]]))
    np.testing.assert_array_equal(found.position, [[1, 2, 3], [6, 5, 4]])
    np.testing.assert_array_equal(found.states.repeats, [2, 2])
    assert found.rotation is None and found.rows == 3


def test_joint_angles_wrench_time_and_temperature_are_averaged_with_their_readings():
    time, warm = np.array([0.0, 2.0, 4.0, 8.0]), np.array([20.0, 21.0, 22.0, 25.0])
    taken = readings(FOUR, time_s=time, temperature_c=warm)
    states = averaged(taken).states
    np.testing.assert_allclose(states.time_s, [1.0, 6.0])
    np.testing.assert_allclose(states.temperature_c, [20.5, 23.5])
    np.testing.assert_allclose(states.joint_angles, taken.joint_angles.reshape(2, 2, 2).mean(axis=1))
    np.testing.assert_allclose(states.wrench, taken.wrench.reshape(2, 2, 6).mean(axis=1))


def test_sessions_poses_loads_and_targets_are_kept_apart():
    keys = [(s, p, load, r, t) for s in (0, 3) for p in (2, 7) for load in (0, 1) for r in (0, 1, 2) for t in (0, 1)]
    found = averaged(readings(keys))
    assert len(found) == 16 and len(found.states) == 8
    expected = sorted({key[:3] for key in keys})
    assert list(zip(found.states.session, found.states.pose, found.states.load, strict=True)) == expected
    np.testing.assert_array_equal(found.state, np.repeat(np.arange(8), 2))
    np.testing.assert_array_equal(found.target, np.tile([0, 1], 8))
    np.testing.assert_array_equal(found.states.repeats, 3)


def test_cluster_is_the_pose_with_all_its_loads_in_its_session():
    keys = [(s, p, load, 0, t) for s in (0, 1) for p in (4, 9) for load in (0, 1) for t in (0, 1)]
    found = averaged(readings(keys))
    np.testing.assert_array_equal(state_clusters(found.states), [0, 0, 1, 1, 2, 2, 3, 3])
    np.testing.assert_array_equal(found.cluster, np.repeat([0, 1, 2, 3], 4))


def test_clusters_of_readings_are_in_the_order_of_the_file():
    keys = [(1, 4, 0, 0, 0), (0, 9, 1, 0, 0), (0, 4, 0, 0, 0), (1, 4, 1, 2, 1), (0, 9, 0, 1, 0)]
    np.testing.assert_array_equal(state_clusters(readings(keys)), [2, 1, 0, 2, 1])


def test_approaches_from_different_sides_are_different_states():
    approach = np.array([[1.0, 1.0], [-1.0, 1.0], [1.0, 1.0], [1.0, 1.0]])
    found = averaged(readings(FOUR, [[0, 0, 0], [2, 4, 6], [5, 5, 5], [7, 5, 3]], approach=approach))
    np.testing.assert_array_equal(found.states.approach, [[-1, 1], [1, 1], [1, 1]])
    np.testing.assert_array_equal(found.position, [[2, 4, 6], [0, 0, 0], [6, 5, 4]])
    np.testing.assert_array_equal(found.states.repeats, [1, 1, 2])
    np.testing.assert_array_equal(found.cluster, [0, 0, 1])


def test_state_counts_the_repeats_of_the_target_seen_least_often():
    keys = [(0, 0, 0, 0, 0), (0, 0, 0, 1, 0), (0, 0, 0, 2, 0), (0, 0, 0, 0, 1)]
    found = averaged(readings(keys))
    np.testing.assert_array_equal(found.states.repeats, [1])


def test_mean_rotation_is_that_of_scipy():
    rng = np.random.default_rng(1)
    centre = Rotation.random(2, rng=rng)
    # Near half a turn a mean of rotation vectors would be far off.
    centre = Rotation.concatenate([centre[0], Rotation.from_rotvec([np.pi, 0, 0])])
    keys = [(0, p, 0, r, 0) for p in (0, 1) for r in range(5)]
    turned = Rotation.from_rotvec(1e-4 * rng.standard_normal((10, 3))) * centre[np.repeat([0, 1], 5)]
    found = averaged(readings(keys, rotation_vector=turned.as_rotvec()))
    assert found.rows == 6
    for pose in (0, 1):
        expected = turned[5 * pose : 5 * pose + 5].mean().as_matrix()
        # The two means differ in third order of 1e-4 rad.
        np.testing.assert_allclose(found.rotation[pose], expected, rtol=0, atol=1e-11)


def test_each_approach_is_a_state_and_knows_the_averaged_one():
    keys = [(0, p, load, r, t) for p in (0, 1) for load in (0, 1) for r in (0, 1, 2) for t in (0, 1)]
    taken = readings(keys)
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


def test_each_approach_does_not_mix_approaches_from_different_sides():
    approach = np.array([[1.0, 1.0], [-1.0, 1.0], [1.0, 1.0], [1.0, 1.0]])
    assert each_approach(readings(FOUR, approach=approach))[1].tolist() == [0, 1, 2, 2]


def full_readings(seed, loads=2):
    rng = np.random.default_rng(seed)
    keys = [(s, p, load, r, t) for s in (0, 1) for p in range(3) for load in range(loads) for r in (0, 1) for t in (0, 1)]
    count = len(keys)
    pose_of = np.array([3 * s + p for s, p, *_ in keys])
    turned = Rotation.from_rotvec(1e-4 * rng.standard_normal((count, 3))) * Rotation.random(6, rng=rng)[pose_of]
    approach = rng.choice([-1.0, 1.0], (6, 2))[pose_of]
    return readings(
        keys,
        rng.standard_normal((count, 3)),
        rotation_vector=turned.as_rotvec(),
        approach=approach,
        time_s=rng.uniform(0, 9, count),
        temperature_c=rng.uniform(20, 30, count),
    )


@given(st.integers(0, 2**32 - 1))
def test_order_of_the_rows_does_not_matter(seed):
    taken = full_readings(0)
    kept = np.random.default_rng(seed).permutation(len(taken))[: len(taken) - 3]
    one, other = averaged(taken.select(np.sort(kept))), averaged(taken.select(kept))
    for name, value in vars(one.states).items():
        np.testing.assert_allclose(value, getattr(other.states, name), rtol=0, atol=1e-14)
    for name in ("state", "target", "position", "rotation"):
        # Rotations 1e-4 rad apart, averaged about another of them: 1e-12.
        np.testing.assert_allclose(getattr(one, name), getattr(other, name), rtol=0, atol=1e-11)


@given(st.lists(st.booleans(), min_size=12, max_size=12).filter(any))
def test_selected_states_are_those_of_the_selected_readings(kept):
    taken, kept = full_readings(0), np.array(kept)
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


def test_covariates_that_are_not_there_stay_absent():
    taken = replace(full_readings(0), rotation_vector=None, approach=None, time_s=None, temperature_c=None)
    for found in (averaged(taken), each_approach(taken)[0], select_states(averaged(taken), np.arange(12) < 5)):
        states = found.states
        assert found.rotation is None and states.approach is None and states.time_s is None and states.temperature_c is None
