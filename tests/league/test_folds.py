"""The same folds for every method."""

import numpy as np

from elastocal.campaigns.columns import measurements_from
from elastocal_proof.league.folds import WITHIN, dealt, fold_of_each


def test_every_pose_is_held_out_once_and_folds_are_of_one_size(data):
    found = dealt(measurements_from(data.columns), 5, np.random.default_rng(2))
    assert len(found["pose"]) == 24
    for split in WITHIN:
        counts = np.bincount(found[split])
        assert counts[0] == 0 and len(counts) == 6 and np.ptp(counts[1:]) <= 1


def test_a_seed_repeats_itself_and_another_deals_otherwise(data):
    seen = measurements_from(data.columns)
    first, again, other = (dealt(seen, 5, np.random.default_rng(seed))["random"] for seed in (2, 2, 3))
    assert (first == again).all() and (first != other).any()


def test_measurements_of_one_pose_are_in_one_fold(data):
    seen = measurements_from(data.columns)
    fold = fold_of_each(seen, "random", data.dealt)
    for pose, number in zip(data.dealt["pose"], data.dealt["random"], strict=True):
        assert set(fold[seen.pose == pose]) == {number}


def test_blocks_are_neighbours(data):
    """Two poses of one block are closer than two of different ones, on average."""
    seen = measurements_from(data.columns)
    first = np.unique(seen.pose, return_index=True)[1]
    angles, block = seen.joint_angles[first], data.dealt["blocks"]
    apart = np.linalg.norm(np.exp(1j * angles[:, None]) - np.exp(1j * angles), axis=2)
    same = block[:, None] == block
    assert apart[same & ~np.eye(24, dtype=bool)].mean() < 0.95 * apart[~same].mean()
