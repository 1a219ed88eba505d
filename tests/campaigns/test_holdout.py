"""Poses that are held out: a split never parts a pose, depends on nothing but its seed,
and leaves enough on both sides."""

import time

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


def poses_of(measurements):
    return set(
        zip(measurements.session.tolist(), measurements.pose.tolist(), strict=True)
    )


def parts(cell, **holdout):
    """Poses that are fitted, and poses that are held out."""
    cell.document |= {"holdout": holdout} if holdout else {}
    fitted, held_out = map(poses_of, split_poses(cell.read()))
    assert fitted.isdisjoint(held_out)
    return fitted, held_out


@settings(max_examples=8)
@given(st.randoms(use_true_random=False))
def test_split_is_the_same_whatever_the_order_of_the_rows(tmp_path_factory, random):
    cell = Cell(tmp_path_factory.mktemp("campaign"))
    cell.repeat_as_session_7()
    expected = parts(cell)
    order = list(range(len(cell.table["pose"])))
    random.shuffle(order)
    cell.keep(order)
    assert parts(cell) == expected


# Rounded to whole poses; five to fit and two held out are enough.
ENOUGH = [
    ({"poses": [0, 2, 4, 6, 8]}, 5, 5),
    ({"fraction": 0.5}, 5, 5),
    ({"fraction": 0.16}, 8, 2),
]


@pytest.mark.parametrize(("holdout", "fitted", "held_out"), ENOUGH)
def test_whole_poses_are_held_out(cell, holdout, fitted, held_out):
    assert tuple(map(len, parts(cell, **holdout))) == (fitted, held_out)


@pytest.mark.parametrize(
    ("holdout", "key", "words"),
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
def test_faulty_holdout_is_refused_in_one_line(cell, holdout, key, words):
    cell.document["holdout"] = holdout
    with refused(f"{cell.source}: ", f" {key}", *words):
        cell.read()


def test_the_seed_of_a_draw_is_1_where_none_is_stated(cell):
    one, other, unstated = (
        parts(cell, fraction=0.4, **seed) for seed in ({"seed": 1}, {"seed": 5}, {})
    )
    assert one == unstated != other


def test_poses_of_one_configuration_are_fitted_or_held_out_together(cell):
    """Every configuration is measured again under a pose number of its own: the draw is
    that of the configurations."""
    once = parts(cell, fraction=0.3, seed=2)[1]
    again = {name: list(column) for name, column in cell.table.items()}
    again["pose"] = [pose + POSES for pose in again["pose"]]
    cell.table = {name: [*column, *again[name]] for name, column in cell.table.items()}
    assert parts(cell)[1] == once | {(session, pose + POSES) for session, pose in once}


def test_a_lost_row_with_a_pose_number_of_its_own_changes_no_draw(cell):
    before = parts(cell, fraction=0.3, seed=2)
    lost = {"pose": POSES, "target": "A", "time_s": 60.0 * len(cell.table["pose"])}
    cell.table = {
        name: [*column, lost.get(name, 0)] for name, column in cell.table.items()
    }
    after = parts(cell)
    assert tuple(poses - {(0, POSES)} for poses in after) == before


def test_poses_of_one_configuration_alone_are_refused_soon(cell):
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
    begun = time.process_time()
    assert (
        number_configurations(angles, np.arange(len(angles))).tolist()
        == [0, 1] * 50_000
    )
    assert time.process_time() - begun < 10.0


def test_blocks_are_clusters_whatever_the_order_of_the_poses_and_whole_turns():
    rng = np.random.default_rng(1)
    centres = np.array([[0, 0, 0], [2, 0, 1], [0, 2, -1], [-2, -2, 0]])
    of = rng.permutation(np.repeat(np.arange(4), 6))
    angles = centres[of] + 0.15 * rng.standard_normal((24, 3))
    order = rng.permutation(24)
    found = partition_poses(angles, np.arange(24), 4)
    assert len({(block, centre) for block, centre in zip(found, of, strict=True)}) == 4
    turned = angles[order] + 2 * np.pi * rng.integers(-1, 2, (24, 3))
    np.testing.assert_array_equal(
        partition_poses(turned, np.arange(24), 4), found[order]
    )
    np.testing.assert_array_equal(
        partition_poses(np.tile(angles, (2, 1)), np.arange(48), 4), np.tile(found, 2)
    )


@pytest.mark.parametrize(("poses", "joints"), [(2, 1), (5, 6), (20, 2), (60, 6)])
def test_a_pose_is_beyond_the_range_from_the_margin_on_that_chance_leaves_once_in_twenty(
    poses, joints
):
    """Of poses from a box: 2 n (1 + t)^(1 - P) / (P + 1) = 0.05, solved for the share t
    of the range."""
    share = brentq(
        lambda t: 2 * joints * (1 + t) ** (1 - poses) / (poses + 1) - 0.05, 1e-6, 1e4
    )
    angles = np.random.default_rng(poses).uniform(-1, 1, (poses, joints)) * np.arange(
        1, joints + 1
    )
    low = angles.min(axis=0)
    high = angles.max(axis=0)
    assert (share * (high - low) > 0.02).all()
    for joint in range(joints):
        for edge, sign in ((low, -1), (high, 1)):
            for factor, beyond in ((1 - 1e-9, False), (1 + 1e-9, True)):
                pose = 0.5 * (low + high)
                pose[joint] = edge[joint] + factor * sign * share * (
                    high[joint] - low[joint]
                )
                assert find_poses_beyond_range(angles, pose[None]).tolist() == [
                    beyond
                ], (
                    joint,
                    sign,
                )


def test_a_pose_repeats_another_where_no_joint_stands_elsewhere_than_one_pose_may():
    fitted = np.random.default_rng(3).uniform(-2, 2, (30, 6))
    almost = fitted[[4, 17]] + 0.9 * SAME_POSE_RAD
    elsewhere = fitted[[4, 17]].copy()
    elsewhere[:, 5] += 1.1 * SAME_POSE_RAD
    assert (
        find_repeated(fitted, almost).all()
        and not find_repeated(fitted, elsewhere).any()
    )
    # Each joint at the angle that it had in another pose is a pose of its own.
    assert not find_repeated(fitted, np.diag(fitted[:6])[None] * np.ones((1, 6))).any()


def test_a_row_is_alike_to_the_first_that_began_a_number_near_it_and_poses_are_so_by_their_means():
    points = np.random.default_rng(5).uniform(0, 1, (300, 2))
    leaders = []
    expected = []
    for row in points:
        alike = [
            number
            for number, first in enumerate(leaders)
            if np.abs(row - first).max() <= 0.1
        ]
        leaders += [] if alike else [row]
        expected.append(alike[0] if alike else len(leaders) - 1)
    np.testing.assert_array_equal(number_close_points(points, 0.1), expected)
    spread = (SAME_POSE_RAD / 0.1) * np.repeat(points, 2, axis=0) + np.tile(
        [[1.0], [-1.0]], (300, 1)
    )
    np.testing.assert_array_equal(
        number_configurations(spread, np.repeat(np.arange(300), 2)), expected
    )
