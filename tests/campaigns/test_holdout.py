"""Held-out poses: a split never divides a pose, depends only on its seed, and leaves
enough poses on both sides."""

import time
from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from made_cells import POSES, Cell
from scipy.optimize import brentq
from support import refused

from elastocal.campaigns.holdout import (
    SAME_POSE_RAD,
    find_poses_beyond_range,
    find_repeated,
    number_close_points,
    number_configurations,
    partition_poses,
    split_poses,
)


def list_poses(measurements):
    """Return the set of (session, pose)."""
    return set(
        zip(measurements.session.tolist(), measurements.pose.tolist(), strict=True)
    )


def split(cell, **holdout):
    """Return the poses that are fitted and the poses that are held out."""
    if holdout:
        cell.document["holdout"] = holdout
    fitted, held_out = map(list_poses, split_poses(cell.read()))
    assert fitted.isdisjoint(held_out)
    return fitted, held_out


@settings(max_examples=8)
@given(st.randoms(use_true_random=False))
def test_a_split_does_not_depend_on_the_order_of_the_rows(tmp_path_factory, random):
    cell = Cell(tmp_path_factory.mktemp("campaign"))
    cell.repeat_as_session_7()
    expected = split(cell)
    order = list(range(len(cell.table["pose"])))
    random.shuffle(order)
    cell.keep(order)
    assert split(cell) == expected


# Shares are rounded to whole poses. Five fitted and two held-out poses are enough.
SUFFICIENT_SPLITS = [
    ({"poses": [0, 2, 4, 6, 8]}, 5, 5),
    ({"fraction": 0.5}, 5, 5),
    ({"fraction": 0.16}, 8, 2),
]


@pytest.mark.parametrize(("holdout", "fitted", "held_out"), SUFFICIENT_SPLITS)
def test_whole_poses_are_held_out(cell, holdout, fitted, held_out):
    assert tuple(map(len, split(cell, **holdout))) == (fitted, held_out)


@pytest.mark.parametrize(
    ("holdout", "key", "phrases"),
    [
        ({}, "holdout", ["found {}"]),
        (
            {"fraction": 0.3, "poses": [1, 2]},
            "holdout",
            ["'fraction': 0.3, 'poses'", "one of"],
        ),
        ({"poses": [1, 2], "seed": 1}, "holdout", ["'seed': 1", "one of"]),
        ({"seed": 1}, "holdout", ["{'seed': 1}", "{fraction, seed}"]),
        ({"poses": [3, 12]}, "holdout.poses", ["found 12", "0..9"]),
        ({"poses": [3, [1, 4]]}, "holdout.poses", ["[1, 4]", "0..9"]),
        (
            {"poses": [3]},
            "holdout",
            ["9 configurations to fit and 1 held out", "2 held out"],
        ),
        (
            {"poses": [3, 4, 5, 6, 7, 8]},
            "holdout",
            ["4 configurations to fit and 6 held out", "5 to fit"],
        ),
        (
            {"campaign": "../nowhere"},
            "holdout.campaign",
            ["'../nowhere'", "campaign.yaml"],
        ),
    ],
)
def test_a_faulty_holdout_is_refused_in_one_line(cell, holdout, key, phrases):
    cell.document["holdout"] = holdout
    with refused(f"{cell.source}: ", f" {key}", *phrases):
        cell.read()


def test_the_default_seed_is_1(cell):
    with_seed_1 = split(cell, fraction=0.4, seed=1)
    with_seed_5 = split(cell, fraction=0.4, seed=5)
    by_default = split(cell, fraction=0.4)
    assert by_default == with_seed_1
    assert by_default != with_seed_5


def test_poses_of_one_configuration_are_fitted_or_held_out_together(cell):
    """Every configuration is measured again under a new pose number. The draw is one of
    configurations, so it does not change."""
    once = split(cell, fraction=0.3, seed=2)[1]
    again = {name: list(column) for name, column in cell.table.items()}
    again["pose"] = [pose + POSES for pose in again["pose"]]
    cell.table = {name: [*column, *again[name]] for name, column in cell.table.items()}
    assert split(cell)[1] == once | {(session, pose + POSES) for session, pose in once}


def test_a_stray_row_with_its_own_pose_number_changes_no_draw(cell):
    before = split(cell, fraction=0.3, seed=2)
    stray = {"pose": POSES, "target": "A", "time_s": 60.0 * len(cell.table["pose"])}
    cell.table = {
        name: [*column, stray.get(name, 0)] for name, column in cell.table.items()
    }
    after = split(cell)
    assert tuple(poses - {(0, POSES)} for poses in after) == before


def test_a_campaign_of_one_configuration_is_refused_and_many_poses_take_no_time(cell):
    for name in [name for name in cell.table if name.startswith("q")]:
        cell.table[name] = [cell.table[name][0]] * len(cell.table[name])
    with refused(
        cell.source,
        "holdout",
        "1 configuration to fit and 0 held out",
        "at least 5 to fit",
    ):
        cell.read()
    angles = np.tile(np.random.default_rng(4).uniform(-2, 2, (2, 6)), (50_000, 1))
    start = time.process_time()
    assert (
        number_configurations(angles, np.arange(len(angles))).tolist()
        == [0, 1] * 50_000
    )
    assert time.process_time() - start < 10.0


def test_blocks_are_clusters_regardless_of_the_order_of_poses_and_of_full_turns():
    rng = np.random.default_rng(1)
    centres = np.array([[0, 0, 0], [2, 0, 1], [0, 2, -1], [-2, -2, 0]])
    centre_index = rng.permutation(np.repeat(np.arange(4), 6))
    angles = centres[centre_index] + 0.15 * rng.standard_normal((24, 3))
    order = rng.permutation(24)
    blocks = partition_poses(angles, np.arange(24), 4)
    assert len(set(zip(blocks, centre_index, strict=True))) == 4
    rotated = angles[order] + 2 * np.pi * rng.integers(-1, 2, (24, 3))
    np.testing.assert_array_equal(
        partition_poses(rotated, np.arange(24), 4), blocks[order]
    )
    np.testing.assert_array_equal(
        partition_poses(np.tile(angles, (2, 1)), np.arange(48), 4), np.tile(blocks, 2)
    )


@pytest.mark.parametrize(("poses", "joints"), [(2, 1), (5, 6), (20, 2), (60, 6)])
def test_a_pose_is_beyond_the_range_from_the_margin_that_chance_exceeds_once_in_twenty(
    poses, joints
):
    """For poses that are uniform in a box, the margin is the share t of the range with
    2 n (1 + t)^(1 - P) / (P + 1) = 0.05."""
    share = brentq(
        lambda t: 2 * joints * (1 + t) ** (1 - poses) / (poses + 1) - 0.05, 1e-6, 1e4
    )
    angles = np.random.default_rng(poses).uniform(-1, 1, (poses, joints)) * np.arange(
        1, joints + 1
    )
    low = angles.min(axis=0)
    high = angles.max(axis=0)
    margin = share * (high - low)
    assert (margin > 0.02).all()
    for joint, (edge, sign) in product(range(joints), ((low, -1), (high, 1))):
        for factor, is_beyond in ((1 - 1e-9, False), (1 + 1e-9, True)):
            pose = 0.5 * (low + high)
            pose[joint] = edge[joint] + factor * sign * margin[joint]
            beyond = find_poses_beyond_range(angles, pose[None]).tolist()
            assert beyond == [is_beyond], (joint, sign)


def test_a_pose_repeats_another_if_no_joint_differs_by_more_than_within_a_pose():
    fitted = np.random.default_rng(3).uniform(-2, 2, (30, 6))
    nearly_equal = fitted[[4, 17]] + 0.9 * SAME_POSE_RAD
    assert find_repeated(fitted, nearly_equal).all()
    different = fitted[[4, 17]].copy()
    different[:, 5] += 1.1 * SAME_POSE_RAD
    assert not find_repeated(fitted, different).any()
    # A pose is new if each of its joints has the angle of a different fitted pose.
    combined = np.diag(fitted[:6])[None] * np.ones((1, 6))
    assert not find_repeated(fitted, combined).any()


def number_by_leaders(points, tolerance):
    """Number points in order: a point gets the number of the first leader within the
    tolerance, or becomes a leader."""
    leaders = []
    numbers = []
    for point in points:
        close = [
            number
            for number, leader in enumerate(leaders)
            if np.abs(point - leader).max() <= tolerance
        ]
        if close:
            numbers.append(close[0])
        else:
            numbers.append(len(leaders))
            leaders.append(point)
    return numbers


def test_points_are_numbered_by_their_first_leader_and_poses_by_their_mean_angles():
    points = np.random.default_rng(5).uniform(0, 1, (300, 2))
    expected = number_by_leaders(points, 0.1)
    np.testing.assert_array_equal(number_close_points(points, 0.1), expected)
    # Each pose has two rows that deviate from their mean by one radian.
    means = (SAME_POSE_RAD / 0.1) * np.repeat(points, 2, axis=0)
    rows = means + np.tile([[1.0], [-1.0]], (300, 1))
    np.testing.assert_array_equal(
        number_configurations(rows, np.repeat(np.arange(300), 2)), expected
    )
