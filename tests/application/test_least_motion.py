"""The path with the least motion through candidates of each row."""

import itertools

import numpy as np
import pytest

from elastocal.application.least_motion import (
    PathCandidates,
    _accumulate_costs,
    _find_least_excess,
    _find_smooth_path,
    find_least_motion,
)

EXCESS_WEIGHT = 1e4


def compute_motion_cost(step, allowed):
    """Length of steps (..., n) with the weighted excess above the allowed ones."""
    excess = np.maximum(step - allowed, 0.0)
    return (step + EXCESS_WEIGHT * excess).sum(axis=-1)


def find_least_cost(lowest, counts, limits, allowed):
    """Cost of the best path through all combinations of postures and turns."""
    turns = np.array(list(itertools.product(*map(range, counts))))
    previous = total = None
    for row in range(lowest.shape[1]):
        angles = (lowest[:, row, None] + 2 * np.pi * turns).reshape(-1, len(counts))
        cost = np.where((angles > limits[:, 1]).any(axis=1), np.inf, 0.0)
        if row:
            step = np.abs(angles[:, None] - previous[None])
            motion = compute_motion_cost(step, allowed[row - 1])
            cost += (motion + total).min(axis=1)
        previous = angles
        total = cost
    return total.min()


def test_the_least_motion_is_the_best_of_all_paths_through_all_postures_and_turns():
    stream = np.random.default_rng(2)
    counts = (1, 2, 3)
    limits = np.array([[-4.0, 4.0], [-4.0, 7.0], [-4.0, 14.0]])
    for _ in range(10):
        lowest = stream.uniform(-3, 3, (2, 4, 3))
        allowed = stream.uniform(0.5, 3, (3, 3))
        copies = [
            lowest[..., joint, None] + 2 * np.pi * np.arange(count)
            for joint, count in enumerate(counts)
        ]
        path = find_least_motion(
            PathCandidates(copies, limits, np.zeros((2, 4)), allowed)
        )
        step = np.abs(np.diff(path, axis=0))
        least_cost = find_least_cost(lowest, counts, limits, allowed)
        cost = compute_motion_cost(step, allowed).sum()
        assert cost == pytest.approx(least_cost, abs=1e-2)


def draw_smooth_candidates(stream, renumbered, rows=12, postures=3, joints=3):
    """Draw postures that move by up to 0.2 rad a row within limits of up to three turns;
    steps of 0.3 rad are allowed. They may be numbered anew at each row."""
    limits = np.stack(
        [np.full(joints, -4.0), stream.uniform(0.0, 14.0, joints)], axis=1
    )
    steps = stream.uniform(-0.2, 0.2, (postures, rows, joints))
    angles = stream.uniform(-4.0, 4.0, (postures, 1, joints)) + steps.cumsum(axis=1)
    if renumbered:
        order = stream.permuted(np.tile(np.arange(postures)[:, None], rows), axis=0)
        angles = np.take_along_axis(angles, order[..., None], axis=0)
    lowest = -4.0 + (angles + 4.0) % (2 * np.pi)
    width = limits[:, 1] - limits[:, 0]
    counts = np.maximum(1, np.ceil(width / (2 * np.pi))).astype(int)
    copies = [
        lowest[..., joint, None] + 2 * np.pi * np.arange(count)
        for joint, count in enumerate(counts)
    ]
    exclusion = np.where(stream.random((postures, rows)) < 0.1, np.inf, 0.0)
    allowed = np.full((rows - 1, joints), 0.3)
    return PathCandidates(copies, limits, exclusion, allowed)


@pytest.mark.parametrize("renumbered", [True, False])
def test_a_smooth_path_is_the_best_of_all_paths(renumbered):
    """Both searches agree wherever a path without large steps exists; 0.3 rad of excess
    would cost more than any motion."""
    stream = np.random.default_rng(4)
    found = 0
    for _ in range(30):
        candidates = draw_smooth_candidates(stream, renumbered)
        states = _find_smooth_path(candidates)
        best = _find_least_excess(candidates)
        path = find_least_motion(candidates)
        steps = np.abs(np.diff(path, axis=0))
        if states is None:
            least_cost = _accumulate_costs(candidates)[-1].min()
            assert (steps > 0.3).any() or np.isinf(least_cost)
        else:
            found += 1
            np.testing.assert_array_equal(states, best)
            assert (steps <= 0.3).all()
    assert 8 <= found <= 28


def test_steps_of_half_a_turn_are_left_to_the_full_search():
    candidates = draw_smooth_candidates(np.random.default_rng(5), renumbered=True)
    candidates.allowed[3, 1] = np.pi
    assert _find_smooth_path(candidates) is None
