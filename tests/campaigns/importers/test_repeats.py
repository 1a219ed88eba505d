"""Rows at one pose are its repeats, in the order in which they come."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.cluster.hierarchy import fcluster, linkage
from scipy.spatial.distance import pdist

from elastocal.campaigns.importers.repeats import pose_and_repeat


def test_poses_are_numbered_as_they_first_come_and_repeats_as_they_follow():
    a, b, c = [0.1, 0.2], [0.3, -0.2], [-1.0, 2.0]
    pose, repeat = pose_and_repeat(np.array([c, a, c, b, a, c]))
    assert pose.tolist() == [0, 1, 0, 2, 1, 0]
    assert repeat.tolist() == [0, 0, 1, 0, 1, 2]
    assert pose.dtype == repeat.dtype == np.int32


def test_without_a_tolerance_only_the_very_same_angles_are_a_repeat():
    angles = np.array([[1.0, 2.0], [1.0, np.nextafter(2.0, 3.0)], [1.0, 2.0]])
    assert pose_and_repeat(angles)[0].tolist() == [0, 1, 0]


@pytest.mark.parametrize(("difference", "poses"), [([0.9, 0.9, 0.9], [0, 0]), ([0.0, 0.0, 1.1], [0, 1])])
def test_every_angle_must_lie_within_the_tolerance_by_itself(difference, poses):
    angles = np.array([[0.0, 0.0, 0.0], difference]) * 1e-3
    assert pose_and_repeat(angles, 1e-3)[0].tolist() == poses


def test_a_chain_of_near_rows_is_one_pose():
    angles = np.array([[0.0], [3.0], [0.9], [1.8]])
    pose, repeat = pose_and_repeat(angles, 1.0)
    assert pose.tolist() == [0, 1, 0, 0] and repeat.tolist() == [0, 0, 1, 2]


def test_repeats_among_many_rows_keep_their_order():
    pose, repeat = pose_and_repeat(np.random.default_rng(1).integers(0, 3, (2000, 1)).astype(float))
    for number in range(3):
        assert repeat[pose == number].tolist() == list(range((pose == number).sum()))


def test_one_row_is_one_pose():
    assert [part.tolist() for part in pose_and_repeat(np.zeros((1, 6)))] == [[0], [0]]


@given(st.lists(st.tuples(st.integers(-6, 6), st.integers(-6, 6)), min_size=2, max_size=25))
@settings(max_examples=20)
def test_poses_are_the_single_linkage_clusters_of_scipy(rows):
    angles = np.array(rows, float)
    expected = fcluster(linkage(pdist(angles, "chebyshev"), "single"), 1.5, "distance")
    pose, repeat = pose_and_repeat(angles, 1.5)
    np.testing.assert_array_equal(pose[:, None] == pose, expected[:, None] == expected)
    assert list(dict.fromkeys(pose.tolist())) == list(range(pose.max() + 1))
    for number in range(pose.max() + 1):
        assert repeat[pose == number].tolist() == list(range((pose == number).sum()))
