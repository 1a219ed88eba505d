"""Joint space: blocks of neighbours that any order of the poses gives, and ranges that chance does not leave."""

import numpy as np
import pandas as pd
import pytest
from scipy.optimize import brentq

from elastocal.campaigns.joint_space import SAME_POSE_RAD, beyond_range, blocks, configurations, find_repeated


def test_blocks_are_clusters_where_there_are_some():
    rng = np.random.default_rng(1)
    centres = np.array([[0, 0, 0], [2, 0, 1], [0, 2, -1], [-2, -2, 0]])
    of = rng.permutation(np.repeat(np.arange(4), 6))
    found = blocks(centres[of] + 0.05 * rng.standard_normal((24, 3)), 4)
    assert len({(block, centre) for block, centre in zip(found, of, strict=True)}) == 4


def test_blocks_do_not_depend_on_the_order_of_the_poses_nor_on_whole_turns():
    rng = np.random.default_rng(2)
    angles, order = rng.uniform(-2, 2, (23, 6)), rng.permutation(23)
    found = blocks(angles, 4)
    np.testing.assert_array_equal(blocks(angles[order], 4), found[order])
    np.testing.assert_array_equal(blocks(angles + 2 * np.pi * rng.integers(-1, 2, (23, 6)), 4), found)


@pytest.mark.parametrize(("poses", "joints"), [(2, 1), (5, 6), (20, 2), (60, 6)])
def test_a_pose_is_beyond_the_range_from_the_margin_on_that_chance_leaves_once_in_twenty(poses, joints):
    """Of poses from a box: 2 n (1 + t)^(1 - P) / (P + 1) = 0.05, solved for the share t of the range."""
    share = brentq(lambda t: 2 * joints * (1 + t) ** (1 - poses) / (poses + 1) - 0.05, 1e-6, 1e4)
    angles = np.random.default_rng(poses).uniform(-1, 1, (poses, joints)) * np.arange(1, joints + 1)
    low, high = angles.min(axis=0), angles.max(axis=0)
    assert (share * (high - low) > 0.02).all()
    for joint in range(joints):
        for edge, sign in ((low, -1), (high, 1)):
            for factor, beyond in ((1 - 1e-9, False), (1 + 1e-9, True)):
                pose = 0.5 * (low + high)
                pose[joint] = edge[joint] + factor * sign * share * (high[joint] - low[joint])
                assert beyond_range(angles, pose[None]).tolist() == [beyond], (joint, sign)


def test_a_pose_repeats_another_where_no_joint_stands_elsewhere_than_one_pose_may():
    fitted = np.random.default_rng(3).uniform(-2, 2, (30, 6))
    almost, elsewhere = fitted[[4, 17]] + 0.9 * SAME_POSE_RAD, fitted[[4, 17]].copy()
    elsewhere[:, 5] += 1.1 * SAME_POSE_RAD
    assert find_repeated(fitted, almost).all() and not find_repeated(fitted, elsewhere).any()
    # Each joint at the angle that it had in another pose is a pose of its own.
    assert not find_repeated(fitted, np.diag(fitted[:6])[None] * np.ones((1, 6))).any()


def test_a_hundred_thousand_poses_of_one_configuration_take_seconds():
    import time

    angles = np.tile(np.random.default_rng(4).uniform(-2, 2, (2, 6)), (50_000, 1))
    begun = time.process_time()
    assert configurations(angles, np.arange(len(angles))).tolist() == [0, 1] * 50_000
    assert time.process_time() - begun < 10.0


def test_repeats_of_a_pose_are_one_configuration_in_the_order_of_the_poses():
    rng = np.random.default_rng(5)
    apart = rng.uniform(-2, 2, (12, 6))
    near = apart[5] + 1.1 * SAME_POSE_RAD * np.eye(6)[:3]
    angles = np.concatenate([apart, near, apart[8:11] + 0.9 * SAME_POSE_RAD])
    order = rng.permutation(18)
    found = configurations(np.repeat(angles[order], 2, axis=0), np.repeat(np.arange(18), 2))
    names = np.concatenate([np.arange(15), [8, 9, 10]])[order]
    np.testing.assert_array_equal(found, pd.factorize(names)[0])
