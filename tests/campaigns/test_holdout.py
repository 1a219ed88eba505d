"""Poses that are held out: a split never parts a pose, depends on nothing but its seed, and leaves enough on both sides."""

import time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from made_cells import DOCUMENT, POSES, Cell
from scipy.optimize import brentq
from support import refused

from elastocal.campaigns.holdout import SAME_POSE_RAD, beyond_range, blocks, configurations, find_repeated, number_alike, split


def poses_of(measurements):
    return set(zip(measurements.session.tolist(), measurements.pose.tolist(), strict=True))


def parts(cell, **holdout):
    """Poses that are fitted, and poses that are held out."""
    cell.document |= {"holdout": holdout} if holdout else {}
    fitted, held_out = map(poses_of, split(cell.read()))
    assert fitted.isdisjoint(held_out)
    return fitted, held_out


@settings(max_examples=8)
@given(st.randoms(use_true_random=False))
def test_split_is_the_same_whatever_the_order_of_the_rows(tmp_path_factory, random):
    cell = Cell(tmp_path_factory.mktemp("campaign"))
    cell.repeat_as_session_7()
    expected, order = parts(cell), list(range(len(cell.table["pose"])))
    random.shuffle(order)
    cell.keep(order)
    assert parts(cell) == expected


def test_a_block_of_neighbours_is_held_out_by_its_seed(cell):
    found = {frozenset(parts(cell, blocks=3, seed=seed)[1]) for seed in range(20)}
    # Blocks part the poses: whatever the seed, it is one of three, which together are all.
    assert len(found) == 3 and sum(map(len, found)) == POSES == len(frozenset.union(*found))
    cell.document["holdout"] = {"blocks": 3}
    assert cell.read().holdout == {"blocks": 3, "seed": 1}


# Rounded to whole poses; five to fit and two held out are enough.
ENOUGH = [({"poses": [0, 2, 4, 6, 8]}, 5, 5), ({"fraction": 0.5}, 5, 5), ({"fraction": 0.16}, 8, 2), ({"blocks": 2}, 5, 5)]


@pytest.mark.parametrize(("holdout", "fitted", "held_out"), ENOUGH)
def test_whole_poses_are_held_out(cell, holdout, fitted, held_out):
    assert tuple(map(len, parts(cell, **holdout))) == (fitted, held_out)


def test_a_session_is_held_out_where_five_poses_of_others_are_left(cell):
    """Of the first seven poses two were measured in a session of their own; of six that leaves too few."""
    later = np.array(cell.table["pose"]) < 2
    cell.table["session"] = later.astype(int).tolist()
    cell.table["target"] = [f"{name}2" if late else name for name, late in zip(cell.table["target"], later, strict=True)]
    cell.document["targets"] = cell.document["targets"] | {"A2": DOCUMENT["targets"]["A"], "B2": DOCUMENT["targets"]["B"]}
    cell.keep([n for n, pose in enumerate(cell.table["pose"]) if pose < 7])
    fitted, held_out = parts(cell, session=1)
    assert held_out == {(1, 0), (1, 1)} and len(fitted) == 5
    cell.keep([n for n, pose in enumerate(cell.table["pose"]) if pose < 6])
    with refused(cell.source, "holdout", "4 configurations to fit and 2 held out"):
        cell.read()


@pytest.mark.parametrize(
    ("holdout", "key", "words"),
    [
        ({}, "holdout", ["found {}"]),
        ({"fraction": 0.3, "poses": [1, 2]}, "holdout", ["fraction, poses together", "one of"]),
        ({"poses": [1, 2], "seed": 1}, "holdout", ["poses, seed together", "one of"]),
        ({"seed": 1}, "holdout", ["seed alone", "{fraction, seed}"]),
        ({"poses": [3, 12]}, "holdout.poses", ["found 12", "0..9"]),
        ({"poses": [3, [1, 4]]}, "holdout.poses", ["[1, 4]", "0..9"]),
        ({"blocks": 11}, "holdout.blocks", ["11", "at most as many as configurations, 10"]),
        ({"blocks": 9}, "holdout", ["9 configurations to fit and 1 held out", "2 held out"]),
        ({"campaign": "../nowhere"}, "holdout.campaign", ["'../nowhere'", "campaign.yaml"]),
        ({"session": 3}, "holdout.session", ["found 3", "sessions that were measured: 0"]),
    ],
)
def test_faulty_holdout_is_refused_in_one_line(cell, holdout, key, words):
    cell.document["holdout"] = holdout
    with refused(f"{cell.source}: ", f" {key}", *words):
        cell.read()


@pytest.mark.parametrize("holdout", [{"fraction": 0.3, "seed": 2}, {"blocks": 3, "seed": 1}])
def test_poses_of_one_configuration_are_fitted_or_held_out_together(cell, holdout):
    """Every configuration is measured again under a pose number of its own: the draw is that of the configurations."""
    once = parts(cell, **holdout)[1]
    again = {name: list(column) for name, column in cell.table.items()}
    again["pose"] = [pose + POSES for pose in again["pose"]]
    cell.table = {name: [*column, *again[name]] for name, column in cell.table.items()}
    assert parts(cell)[1] == once | {(session, pose + POSES) for session, pose in once}


def test_poses_of_one_configuration_alone_are_refused_soon(cell):
    for name in [name for name in cell.table if name.startswith("q")]:
        cell.table[name] = [cell.table[name][0]] * len(cell.table[name])
    with refused(cell.source, "holdout", "1 configuration to fit and 0 held out", "at least 5 to fit"):
        cell.read()
    angles = np.tile(np.random.default_rng(4).uniform(-2, 2, (2, 6)), (50_000, 1))
    begun = time.process_time()
    assert configurations(angles, np.arange(len(angles))).tolist() == [0, 1] * 50_000
    assert time.process_time() - begun < 10.0


def test_blocks_are_clusters_whatever_the_order_of_the_poses_and_whole_turns():
    rng = np.random.default_rng(1)
    centres = np.array([[0, 0, 0], [2, 0, 1], [0, 2, -1], [-2, -2, 0]])
    of = rng.permutation(np.repeat(np.arange(4), 6))
    angles, order = centres[of] + 0.05 * rng.standard_normal((24, 3)), rng.permutation(24)
    found = blocks(angles, 4)
    assert len({(block, centre) for block, centre in zip(found, of, strict=True)}) == 4
    np.testing.assert_array_equal(blocks(angles[order] + 2 * np.pi * rng.integers(-1, 2, (24, 3)), 4), found[order])


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


def test_a_row_is_alike_to_the_first_that_began_a_number_near_it_and_poses_are_so_by_their_means():
    points, leaders, expected = np.random.default_rng(5).uniform(0, 1, (300, 2)), [], []
    for row in points:
        alike = [number for number, first in enumerate(leaders) if np.abs(row - first).max() <= 0.1]
        leaders += [] if alike else [row]
        expected.append(alike[0] if alike else len(leaders) - 1)
    np.testing.assert_array_equal(number_alike(points, 0.1), expected)
    spread = (SAME_POSE_RAD / 0.1) * np.repeat(points, 2, axis=0) + np.tile([[1.0], [-1.0]], (300, 1))
    np.testing.assert_array_equal(configurations(spread, np.repeat(np.arange(300), 2)), expected)
