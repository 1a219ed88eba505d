"""Observations average repeats of one state and target, in a fixed order and with
means of rotations."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from synthetic import fill_measurements

from elastocal.fitting.observations import (
    average_repeats,
    index_poses,
    match_states_and_targets,
    remove_outlying_repeats,
)


def build_measurements(keys, position=None, **columns):
    """Build measurements from rows of (session, pose, load, repeat, target); all other
    columns are random unless they are given."""
    rng = np.random.default_rng(0)
    count = len(keys)
    joint_angles = rng.standard_normal((count, 2))
    wrench = rng.standard_normal((count, 6))
    random_position = rng.standard_normal((count, 3))
    session, pose, load, repeat, target = np.array(keys).T
    return fill_measurements(
        session=session,
        pose=pose,
        load=load,
        repeat=repeat,
        target=target,
        joint_angles=joint_angles,
        wrench=wrench,
        position=random_position if position is None else np.array(position, float),
        **columns,
    )


def make_full_measurements(seed, loads=2):
    """Make measurements of two sessions with three poses each, two repeats and two
    targets."""
    rng = np.random.default_rng(seed)
    keys = [
        (session, pose, load, repeat, target)
        for session in (0, 3)
        for pose in (2, 4, 9)
        for load in range(loads)
        for repeat in (0, 1)
        for target in (0, 1)
    ]
    count = len(keys)
    # The mean of rotation vectors would be far off near a rotation by half a turn.
    centre = Rotation.concatenate(
        [Rotation.random(5, rng=rng), Rotation.from_rotvec([np.pi, 0, 0])]
    )
    pose_index = np.repeat(np.arange(6), count // 6)
    return build_measurements(
        keys,
        rng.standard_normal((count, 3)),
        rotation_vector=(
            Rotation.from_rotvec(1e-4 * rng.standard_normal((count, 3)))
            * centre[pose_index]
        ).as_rotvec(),
        approach=rng.choice([-1.0, 1.0], (6, 2))[pose_index],
        time_s=rng.uniform(0, 9, count),
        temperature_c=rng.uniform(20, 30, count),
    )


def draw_measurements(seed):
    """Draw the order of the rows, three of which are missing; odd seeds also draw the
    side from which each measurement is approached."""
    measurements = make_full_measurements(0)
    rng = np.random.default_rng(seed)
    count = len(measurements)
    if seed % 2:
        approach = rng.choice([-1.0, 1.0], (count, 2))
        measurements = replace(measurements, approach=approach)
    return measurements.select(rng.permutation(count)[: count - 3])


def group_by_state_and_target(measurements):
    """Return the rows of each target of each (session, pose, load, *approach)."""
    rows = {}
    keys = zip(
        measurements.session,
        measurements.pose,
        measurements.load,
        *measurements.approach.T,
        measurements.target,
        strict=True,
    )
    for row, (*state, target) in enumerate(keys):
        rows.setdefault(tuple(state), {}).setdefault(target, []).append(row)
    return rows


def assert_state_is(states, index, key):
    """Check session, pose, load and approach of one state."""
    assert key == (
        states.session[index],
        states.pose[index],
        states.load[index],
        *states.approach[index],
    )


def assert_is_mean(observations, index, measurements, rows):
    """Check that an observation is the mean of these rows; scipy's mean of rotations
    differs from the library's in third order of 1e-4."""
    np.testing.assert_allclose(
        observations.position[index],
        measurements.position[rows].mean(axis=0),
        atol=1e-14,
    )
    rotations = Rotation.from_rotvec(measurements.rotation_vector[rows])
    np.testing.assert_allclose(
        observations.rotation[index], rotations.mean().as_matrix(), rtol=0, atol=1e-11
    )


@given(st.integers(0, 2**32 - 1))
def test_averages_are_those_of_each_session_pose_load_side_and_target_by_hand(seed):
    """This holds for any order of the rows and if some are missing."""
    measurements = draw_measurements(seed)
    observations = average_repeats(measurements)
    states = observations.states
    rows_of_states = group_by_state_and_target(measurements)
    poses = sorted({state[:2] for state in rows_of_states})
    for index, state in enumerate(sorted(rows_of_states)):
        rows_of_targets = rows_of_states[state]
        pose_index = poses.index(state[:2])
        assert_state_is(states, index, state)
        assert states.repeats[index] == min(map(len, rows_of_targets.values()))
        assert index_poses(states)[index] == pose_index
        for target, rows in rows_of_targets.items():
            (observation,) = np.flatnonzero(
                (observations.state == index) & (observations.target == target)
            )
            assert observations.cluster[observation] == pose_index
            assert_is_mean(observations, observation, measurements, rows)
    assert len(states) == len(rows_of_states)
    assert len(observations) == sum(map(len, rows_of_states.values()))
    in_order = average_repeats(measurements.select(np.argsort(measurements.row)))
    for name, value in vars(states).items():
        np.testing.assert_allclose(
            value, getattr(in_order.states, name), rtol=0, atol=1e-14
        )


def test_measurements_of_the_same_state_and_target_are_matched():
    measurements = make_full_measurements(2)
    averages = average_repeats(measurements)
    is_chosen = np.arange(len(averages)) % 3 == 0
    states = averages.states
    chosen_keys = {
        (states.session[state], states.pose[state], states.load[state], target)
        for state, target in zip(
            averages.state[is_chosen], averages.target[is_chosen], strict=True
        )
    }
    keys = zip(
        measurements.session,
        measurements.pose,
        measurements.load,
        measurements.target,
        strict=True,
    )
    matched = match_states_and_targets(measurements, averages, is_chosen)
    assert matched.tolist() == [key in chosen_keys for key in keys]
    matched = match_states_and_targets(averages, averages, is_chosen)
    assert matched.tolist() == is_chosen.tolist()


def make_repeats(repeats, poses=30, seed=0, targets=2, measured_once=0):
    """Make measurements with unit noise: `poses` poses with `repeats` repeats, then
    `measured_once` poses without repeats."""
    keys = [
        (0, pose, 0, repeat, target)
        for pose in range(poses + measured_once)
        for repeat in range(repeats if pose < poses else 1)
        for target in range(targets)
    ]
    rng = np.random.default_rng((1, seed))
    true_position = 1e4 * rng.standard_normal((poses + measured_once, targets, 3))
    position = np.array([true_position[pose, target] for _, pose, _, _, target in keys])
    return build_measurements(keys, position + rng.standard_normal(position.shape))


def list_removed_rows(measurements):
    """Return the rows of the file that are removed as outlying repeats."""
    kept = remove_outlying_repeats(measurements)
    return sorted(set(measurements.row) - set(kept.row))


@pytest.mark.parametrize("repeats", [3, 4, 5])
@pytest.mark.parametrize("error", [[30.0, 0, 0], [0, -30.0, 0], [0, 0, 30.0]])
def test_an_outlying_repeat_is_removed_and_all_others_stay(repeats, error):
    measurements = make_repeats(repeats, seed=1, measured_once=5)
    for outlier in (0, 7, 30 * repeats):
        position = measurements.position.copy()
        position[outlier] += error
        assert list_removed_rows(replace(measurements, position=position)) == [
            outlier + 1
        ]


@pytest.mark.parametrize("repeats", [3, 4, 5, 6, 9])
def test_no_repeat_is_removed_from_clean_noise(repeats):
    """With 3,600 poses, a rate of 1 in 1,000 would be detected with a power of 0.97."""
    removed = 0
    for seed in range(60):
        removed += len(list_removed_rows(make_repeats(repeats, poses=60, seed=seed)))
    assert removed == 0
