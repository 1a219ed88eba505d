"""Joint space: blocks of neighbours that any order of the poses gives, and ranges that chance does not leave."""

import numpy as np
import pytest

from elastocal.campaigns.joint_space import beyond_range, blocks


@pytest.mark.parametrize(("poses", "count"), [(20, 4), (21, 4), (9, 4), (30, 7), (5, 5), (6, 1)])
def test_blocks_are_of_one_size(poses, count):
    found = blocks(np.random.default_rng(poses).uniform(-2, 2, (poses, 6)), count)
    sizes = np.bincount(found, minlength=count)
    assert len(sizes) == count and sizes.sum() == poses
    assert sizes.max() - sizes.min() <= 1


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


def test_a_joint_that_hardly_moves_parts_nothing():
    """Scaled by its spread alone, its noise of a tenth of a milliradian would count as much as the joint that moves."""
    rng = np.random.default_rng(3)
    angles = np.column_stack([np.linspace(-0.5, 0.5, 16), np.where(rng.random(16) < 0.5, 1e-4, -1e-4)])
    np.testing.assert_array_equal(blocks(angles, 2), np.arange(16) // 8)


@pytest.mark.parametrize(("poses", "joints"), [(6, 6), (21, 6), (40, 7)])
def test_one_pose_in_twenty_drawn_like_the_others_is_beyond_their_range(poses, joints):
    """4,000 draws: a rate of 5 % is seen as 4 to 6 %, three standard errors, and one of 7 % is not."""
    rng = np.random.default_rng(4)
    flagged = [beyond_range(rng.uniform(-1, 1, (poses, joints)), rng.uniform(-1, 1, (1, joints)))[0] for _ in range(4000)]
    assert 0.035 < np.mean(flagged) < 0.06


def test_a_joint_far_beyond_is_told_whichever_it_is():
    angles = np.random.default_rng(5).uniform(-1, 1, (30, 4))
    away = np.tile(angles[:1], (8, 1))
    away[np.arange(8), np.repeat(np.arange(4), 2)] = np.tile([-1.5, 1.5], 4)
    assert beyond_range(angles, away).all()
    assert not beyond_range(angles, angles).any()


def test_a_joint_that_stood_still_may_stand_as_exactly_as_a_pose_is_repeated():
    angles = np.random.default_rng(6).uniform(-1, 1, (30, 2)) * [1, 0]
    assert beyond_range(angles, np.array([[0.0, 0.01], [0.0, 0.1]])).tolist() == [False, True]
