"""Frames and screws of a walk along a chain against pinocchio, and where plain numbers stand for arrays."""

from dataclasses import replace

import numpy as np
import pytest
from support import OTHER_CHAINS, PARALLELOGRAM, TRACK, PinocchioPoint, chain_of, random_angles

from elastocal.mechanics.chain_walk import BLOCK, blocks, store_pose, sweep

# Pinocchio has no joint that stands in two places, as those of the parallelogram do.
CHAINS = OTHER_CHAINS | {"track": TRACK}


def stored(frame, count):
    position, rotation = np.full((3, count), np.nan), np.full((3, 3, count), np.nan)
    store_pose(*frame, position, rotation)
    return position.T, np.moveaxis(rotation, -1, 0)


def full(vector, count):
    return np.stack([np.broadcast_to(component, count) for component in vector], axis=-1)


def jacobian_of(screws, point, position, coordinates, count):
    """Of a point from the screws on its way, ndarray (S, 6, C)."""
    found = np.zeros((count, 6, coordinates))
    for screw in screws:
        if screw.place >= point.after:
            continue
        axis = screw.sign * full(screw.axis, count)
        if screw.kind == "T":
            found[:, :3, screw.coordinate] += axis
            continue
        found[:, 3:, screw.coordinate] += axis
        found[:, :3, screw.coordinate] += np.cross(axis, position - full(screw.origin, count))
    return found


@pytest.mark.parametrize("name", CHAINS)
def test_frames_and_screws_are_pinocchios_poses_and_jacobians(name):
    chain, count = chain_of(CHAINS[name]), 5
    angles = random_angles(np.random.default_rng(3), chain, count)
    frames, screws = sweep(chain, np.ascontiguousarray(angles.T), chain.points, lines=True)
    for point, frame in zip(chain.points, frames, strict=True):
        position, rotation = stored(frame, count)
        jacobian = jacobian_of(screws, point, position, chain.coordinates, count)
        model = PinocchioPoint(chain, point)
        for state, row in enumerate(angles):
            for found, wanted in zip((position, rotation, jacobian), model.pose_and_jacobian(row), strict=True):
                np.testing.assert_allclose(found[state], wanted, atol=2e-14)


def test_a_joint_that_stands_in_two_places_has_a_screw_in_each_and_their_sum_is_the_slope():
    chain = chain_of(PARALLELOGRAM)
    angles, step = random_angles(np.random.default_rng(4), chain, 3).T.copy(), 1e-6
    frames, screws = sweep(chain, angles, [chain.end_effector], lines=True)
    assert [screw.coordinate for screw in screws] == [0, 1, 1, 2, 2, 3]
    found = jacobian_of(screws, chain.end_effector, stored(frames[0], 3)[0], 4, 3)
    for joint in range(4):
        shift = step * (np.arange(4) == joint)[:, None]
        ahead, behind = (stored(sweep(chain, angles + sign * shift, [chain.end_effector])[0][0], 3)[0] for sign in (1, -1))
        np.testing.assert_allclose(found[:, :3, joint], (ahead - behind) / (2 * step), atol=1e-8)


def test_what_no_configuration_moves_stays_a_plain_number():
    chain = chain_of("Tz(0.4) Rz(q1) Tx(0.5) Ry(q2) Tz(0.3) [hand]")
    ((axes, origin),) = sweep(chain, np.zeros((2, 4)), chain.points)[0]
    assert {type(component) for component in (*origin, *axes[0], *axes[1], *axes[2])} == {float}
    np.testing.assert_allclose(origin, [0.5, 0.0, 0.7])
    ((axes, origin),) = sweep(chain, np.array([[0.0] * 4, [0.1, 0.2, 0.3, 0.4]]), chain.points)[0]
    assert type(origin[1]) is float and axes[1] == [0.0, 1.0, 0.0]
    np.testing.assert_allclose(origin[2], 0.4 + 0.3 * np.cos([0.1, 0.2, 0.3, 0.4]))


def test_coordinates_that_rest_at_zero_change_no_frame_and_keep_their_screws():
    chain = chain_of(OTHER_CHAINS["seven joints"])
    angles = random_angles(np.random.default_rng(5), chain, 4).T.copy()
    angles[[1, 4]] = 0.0
    frames, screws = sweep(chain, angles, chain.points, lines=True)
    near, others = sweep(chain, angles + 1e-13 * np.isin(np.arange(7), [1, 4])[:, None], chain.points, lines=True)
    for one, other in zip(frames, near, strict=True):
        for found, wanted in zip(stored(one, 4), stored(other, 4), strict=True):
            np.testing.assert_allclose(found, wanted, atol=1e-12)
    assert [screw.coordinate for screw in screws] == [screw.coordinate for screw in others] == list(range(7))


def test_a_screw_has_a_point_only_where_a_point_behind_it_moves():
    chain = chain_of("Rz(q1) Tx(0.5) [A] Rx(q2) Tx(0.3) [B] Rz(q3) Tx(0.1) [C]")
    angles = np.full((3, 1), 0.2)
    assert [screw.origin is None for screw in sweep(chain, angles, [chain.point("B")])[1]] == [False, True]
    assert [screw.origin is None for screw in sweep(chain, angles, [chain.point("C")])[1]] == [False, False, False]
    assert [screw.origin is None for screw in sweep(chain, angles, [chain.point("B")], lines=True)[1]] == [False] * 3


@pytest.mark.parametrize("offset, turns_only", [((0.3, 0.0, 0.0), True), ((0.0, 0.1, 0.0), False), ((0.1, 0.0, -0.1), False)])
def test_a_target_beside_the_axis_is_moved_by_it_and_one_along_it_is_not(offset, turns_only):
    chain = chain_of("Rz(q1) Tx(0.5) Rx(q2) Tx(0.3) [B]")
    point = replace(chain.end_effector, offset_m=offset)
    assert [screw.origin is None for screw in sweep(chain, np.full((2, 1), 0.2), [point])[1]] == [False, turns_only]


@pytest.mark.parametrize("size, lengths", [(0, []), (1, [1]), (BLOCK, [BLOCK]), (2 * BLOCK + 5, [BLOCK, BLOCK, 5])])
def test_blocks_hold_each_configuration_once_and_in_order(size, lengths):
    numbers = np.arange(size)
    parts = [numbers[block] for block in blocks(size)]
    assert [len(part) for part in parts] == lengths
    np.testing.assert_array_equal(np.concatenate([numbers[:0], *parts]), numbers)


def test_half_turns_and_quarter_turns_are_exact_to_rounding():
    chain = chain_of("Rz(q1) Tx(1) [hand]")
    angles = np.array([[np.pi, -np.pi, 0.5 * np.pi, -0.5 * np.pi, 3 * np.pi]])
    position, _ = stored(sweep(chain, angles, chain.points)[0][0], 5)
    np.testing.assert_allclose(position, [[-1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [-1, 0, 0]], atol=1e-15)
