"""The competitor: smooth random displacements by one cause each, the same each time, of the size that their prior says."""

from dataclasses import replace

import numpy as np
import pytest
from support import SEVEN_JOINTS, robot_of
from synthetic import conditions_on, made_states

from elastocal.diagnosis.other import (
    BASE_M,
    BASE_RAD,
    FORCE,
    JOINT_RAD,
    NEIGHBOURS,
    OWN,
    PLACE,
    SHIFT,
    TIME,
    TURN,
    Competitor,
    competitors,
    law_of,
)
from elastocal.effects.conditions import at_states

FEATURES = 40
AT_A_JOINT = [Competitor((4,), law) for law in (OWN, NEIGHBOURS, TIME)]
AT_THE_BASE = [Competitor((), law, motion) for law in (FORCE, TIME, PLACE) for motion in (SHIFT, TURN)]
EVERY = AT_A_JOINT + AT_THE_BASE


def around(count=60, force=500.0, **changes):
    robot = robot_of(SEVEN_JOINTS)
    return conditions_on(robot, replace(made_states(7, count, seed=1, force=force), **changes))


def displacements(states, competitor, features, campaign=None):
    return law_of(competitor, states if campaign is None else campaign, features).displacement(states)


def waves(found):
    return np.array([next(iter(law.values())) for law in found])


def named(competitor):
    return f"{competitor.location} {competitor.name}"


def test_it_acts_by_each_law_at_every_joint_and_at_the_base():
    expected = [Competitor((joint,), law) for joint in range(1, 8) for law in (OWN, NEIGHBOURS, TIME)]
    assert competitors(around()) == [*expected, *AT_THE_BASE]


@pytest.mark.parametrize("competitor", AT_A_JOINT, ids=named)
def test_a_joint_is_displaced_by_about_its_size_in_any_state(competitor):
    """Unloaded all features are of use; what is constant or straight in the angle has been taken off."""
    states = around(400, force=0.0)
    found = displacements(states, competitor, FEATURES)
    assert len(found) == FEATURES and all(set(law) == {3} for law in found)
    squares = (waves(found) ** 2).sum(axis=0)
    assert 0.2 * JOINT_RAD**2 < np.mean(squares) < JOINT_RAD**2
    assert squares.max() < 4 * JOINT_RAD**2


@pytest.mark.parametrize("competitor", [*AT_A_JOINT, *(Competitor((), law, SHIFT) for law in (FORCE, TIME, PLACE))], ids=named)
def test_no_law_has_a_part_that_the_catalogue_has_a_name_for(competitor):
    """A zero offset, a frame, a transmission ratio: half of the features, the others go with the load."""
    states = around()
    found = waves(displacements(states, competitor, FEATURES))
    free = found[: len(found) // 2] if competitor.location else found[:3]
    size = np.abs(free).max()
    np.testing.assert_allclose(free.mean(axis=1), 0.0, atol=1e-9 * size)
    if competitor.law in (OWN, NEIGHBOURS):
        np.testing.assert_allclose(free @ states.joint_angles[:, 3], 0.0, atol=1e-7 * size)


@pytest.mark.parametrize("law", [FORCE, TIME, PLACE])
@pytest.mark.parametrize(("motion", "size", "mine"), [(SHIFT, BASE_M, slice(0, 3)), (TURN, BASE_RAD, slice(3, 6))])
def test_the_base_shifts_or_turns_in_all_three_directions_by_about_its_size(law, motion, size, mine):
    states = around()
    by_coordinate = {}
    for made in displacements(states, Competitor((), law, motion), FEATURES):
        ((coordinate, values),) = made.items()
        by_coordinate.setdefault(coordinate, []).append(values)
    assert list(by_coordinate) == list(states.sites.base[mine])
    first, second, third = (np.array(values) for values in by_coordinate.values())
    assert all(0.1 * size < np.abs(values).max() < 2 * size for values in (first, second, third))
    # Each goes its own way.
    assert np.abs(first - second).max() > 0.1 * size and np.abs(first - third).max() > 0.1 * size


# What each law may depend on beside the load: everything else may change and it stays as it is.
CHANGED = {
    "the joint's own angle": lambda states: replace(states, joint_angles=states.joint_angles + 0.3 * np.eye(7)[3]),
    "the angle beside": lambda states: replace(states, joint_angles=states.joint_angles + 0.3 * np.eye(7)[4]),
    "an angle further off": lambda states: replace(states, joint_angles=states.joint_angles + 0.3 * np.eye(7)[6]),
    "its approach": lambda states: replace(states, approach=states.approach * np.where(np.arange(7) == 3, -1.0, 1.0)),
    "the time": lambda states: replace(states, time_s=states.time_s[::-1].copy()),
    "the temperature": lambda states: replace(states, temperature_c=states.temperature_c[::-1].copy()),
    "the row": lambda states: replace(states, progress=states.progress[::-1].copy()),
}
DEPENDS = {
    (4, OWN): {"the joint's own angle", "its approach"},
    (4, NEIGHBOURS): {"the joint's own angle", "the angle beside"},
    (4, TIME): {"the time", "the temperature", "the row"},
    (0, TIME): {"the time", "the temperature", "the row"},
    (0, FORCE): set(),
}


@pytest.mark.parametrize("what", CHANGED)
@pytest.mark.parametrize(("joint", "law"), DEPENDS)
def test_a_law_goes_by_its_own_cause_alone(joint, law, what):
    """Unloaded, or the load of a joint would change with the angles; the force on the base does not."""
    states = around(force=500.0 if law == FORCE else 0.0)
    moved = CHANGED[what](states)
    competitor = Competitor((joint,), law) if joint else Competitor((), law, SHIFT)
    one, other = (waves(displacements(each, competitor, FEATURES, states)) for each in (states, moved))
    assert (np.abs(one - other).max() > 0.02 * min(JOINT_RAD, BASE_M)) == (what in DEPENDS[joint, law])


@pytest.mark.parametrize("motion", [SHIFT, TURN])
def test_each_coordinate_of_the_base_goes_by_the_load_along_it(motion):
    """The force of the pull and of the weight along each axis, and the moment about it: of the first half of the features."""
    states = around()
    competitor = Competitor((), FORCE, motion)
    mine = states.sites.base[:3] if motion == SHIFT else states.sites.base[3:]
    for changed in mine:
        total = states.total.copy()
        total[:, changed] = total[::-1, changed]
        moved = replace(states)
        vars(moved)["total"] = total
        pairs = zip(*(displacements(each, competitor, FEATURES, states) for each in (states, moved)), strict=True)
        differ = {at for one, other in pairs for at in one if np.abs(one[at] - other[at]).max() > 0.02 * BASE_M}
        assert differ == {changed}


def test_a_coordinate_without_an_input_is_not_displaced():
    """Of a load that always pulls down the foot feels a force along one axis alone."""
    wrench = np.zeros((60, 6))
    wrench[:, 2] = -np.linspace(0, 500, 60)
    found = displacements(around(wrench=wrench), Competitor((), FORCE, SHIFT), FEATURES)
    moved = {coordinate for law in found for coordinate, values in law.items() if values.any()}
    assert moved == {around().sites.base[2]}
    # As many columns as others have, of which units are numbered by those of one state.
    assert len(found) == len(displacements(around(), Competitor((), FORCE, SHIFT), FEATURES))


def test_own_law_and_neighbours_go_by_the_torque_and_the_place_by_where_the_end_is():
    """Of the same function, by the inputs of the campaign: doubled loads, and an end elsewhere."""
    states = around()
    loaded = replace(states, wrench=2.0 * states.wrench)
    for law in (OWN, NEIGHBOURS):
        one, other = (waves(displacements(each, Competitor((4,), law), FEATURES, states)) for each in (states, loaded))
        # Those that are multiplied by the load come after.
        assert np.abs(one - other)[: FEATURES // 2].max() > 0.02 * JOINT_RAD
    turned = states.joint_angles.copy()
    turned[:, 1] += 0.3
    moved = conditions_on(robot_of(SEVEN_JOINTS), replace(made_states(7, 60, seed=1), joint_angles=turned))
    one, other = (waves(displacements(each, Competitor((), PLACE), FEATURES, states)) for each in (states, moved))
    assert np.abs(one - other).max() > 0.02 * BASE_RAD


@pytest.mark.parametrize("competitor", EVERY, ids=named)
def test_it_is_the_same_function_of_some_of_the_states(competitor):
    """Normalised by the campaign: what is made in parts is what is made at once."""
    states = around()
    whole = waves(displacements(states, competitor, FEATURES))
    part = waves(displacements(at_states(states, slice(10, 25)), competitor, FEATURES, states))
    np.testing.assert_allclose(part, whole[:, 10:25], rtol=0, atol=1e-12 * JOINT_RAD)
