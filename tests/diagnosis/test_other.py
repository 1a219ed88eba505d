"""The competitor: smooth random displacements, the same each time, of the size that their prior says."""

from dataclasses import replace

import numpy as np
import pytest
from support import SEVEN_JOINTS, robot_of
from synthetic import circumstances_on, made_states

from elastocal.diagnosis.other import BASE_M, BASE_RAD, JOINT_RAD, displacements, locations
from elastocal.sites import sites_of

FEATURES = 40


def around(count=60, force=500.0, **changes):
    robot = robot_of(SEVEN_JOINTS)
    return circumstances_on(robot, replace(made_states(7, count, seed=1, force=force), **changes))


def waves(found):
    return np.array([next(iter(law.values())) for law in found])


def test_it_acts_at_every_joint_and_at_the_base():
    assert locations(sites_of(robot_of(SEVEN_JOINTS))) == [*((joint,) for joint in range(1, 8)), ()]


@pytest.mark.parametrize("joint", [1, 4, 7])
def test_a_joint_is_displaced_by_about_its_size_in_any_state(joint):
    """Unloaded all features are of use: their squares sum to a chi-square-like spread about the square of the size."""
    states = around(400, force=0.0)
    found = displacements(states, (joint,), FEATURES)
    assert len(found) == FEATURES and all(set(law) == {joint - 1} for law in found)
    squares = (waves(found) ** 2).sum(axis=0)
    assert np.mean(squares) == pytest.approx(JOINT_RAD**2, rel=0.15)
    assert squares.max() < 2 * JOINT_RAD**2


def test_half_of_the_features_vanish_without_the_load():
    states = around(60, force=500.0)
    states.wrench[:20] = 0.0
    states = circumstances_on(robot_of(SEVEN_JOINTS), replace(made_states(7, 60, seed=1), wrench=states.wrench))
    found = waves(displacements(states, (2,), FEATURES))
    zero = ~found[:, :20].any(axis=1)
    assert zero.sum() == FEATURES // 2 and found[zero][:, 20:].any(axis=1).all()


def test_the_base_moves_in_all_its_six_directions():
    states = around()
    found = displacements(states, (), FEATURES)
    by_coordinate = {}
    for law in found:
        ((coordinate, values),) = law.items()
        by_coordinate.setdefault(coordinate, []).append(np.abs(values).max())
    assert set(by_coordinate) == set(states.sites.base)
    largest = [max(by_coordinate[coordinate]) for coordinate in states.sites.base]
    assert all(0.1 * BASE_M < size < 2 * BASE_M for size in largest[:3])
    assert all(0.1 * BASE_RAD < size < 2 * BASE_RAD for size in largest[3:])


def test_it_is_the_same_each_time_and_another_one_at_each_joint():
    states = around()
    one, again, other = (waves(displacements(states, (joint,), FEATURES)) for joint in (2, 2, 3))
    np.testing.assert_array_equal(one, again)
    assert np.abs(one - other).max() > 0.1 * JOINT_RAD


def test_it_is_smooth_in_the_angles():
    """A hundredth of a radian changes it by a few hundredths of its size."""
    states = around(force=0.0)
    moved = replace(states, joint_angles=states.joint_angles + 0.01)
    one, other = (waves(displacements(each, (3,), FEATURES)) for each in (states, moved))
    change = np.sqrt(((one - other) ** 2).sum(axis=0))
    assert 0 < change.max() < 0.15 * JOINT_RAD


def test_what_is_constant_or_absent_is_no_input():
    """A campaign without times and temperatures, or all at one of them, has the same competitor."""
    bare = around(time_s=None, temperature_c=None)
    constant = around(time_s=np.full(60, 7.0), temperature_c=None)
    np.testing.assert_array_equal(*(waves(displacements(states, (1,), FEATURES)) for states in (bare, constant)))
