"""Discrepancies depend on the inputs of one cause, and on nothing that the catalogue
names."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from support import SEVEN_JOINTS, robot_of
from synthetic import conditions_on, made_states

from elastocal.diagnosis.discrepancy import (
    BASE_M,
    BASE_RAD,
    FORCE,
    JOINT_RAD,
    NEIGHBOURS,
    OWN,
    PLACE,
    TIME,
    UNDER_LOAD,
    build_discrepancies,
)

FEATURES = 40
OF_JOINTS = [
    f"{cause}{load}" for cause in (OWN, NEIGHBOURS, TIME) for load in ("", UNDER_LOAD)
]
AT_A_JOINT = [((4,), name) for name in OF_JOINTS]
MOTIONS = {
    FORCE: ("shift", "turn"),
    TIME: ("shift", "turn"),
    PLACE: ("shift x", "shift y", "shift z", "turn"),
}
AT_THE_BASE = [
    ((), f"{cause} {motion}")
    for cause, motions in MOTIONS.items()
    for motion in motions
]
EVERY = pytest.mark.parametrize("law", [*AT_A_JOINT, *AT_THE_BASE], ids=str)


def around(count=60, force=500.0, **changes):
    robot = robot_of(SEVEN_JOINTS)
    return conditions_on(
        robot, replace(made_states(7, count, seed=1, force=force), **changes)
    )


def displacements(states, law, campaign=None):
    """By the law of a location and name, drawn for a campaign."""
    laws = build_discrepancies(states if campaign is None else campaign, FEATURES)
    return next(
        each for each in laws if (each.location, each.name) == law
    ).displacement(states)


def waves(found):
    return np.array([next(iter(law.values())) for law in found])


def test_it_acts_by_each_law_at_every_joint_and_at_the_base():
    expected = [((joint,), name) for joint in range(1, 8) for name in OF_JOINTS]
    assert [
        (law.location, law.name) for law in build_discrepancies(around(), FEATURES)
    ] == [
        *expected,
        *AT_THE_BASE,
    ]
    # What does not bear a load cannot yield to it.
    unloaded = [
        law.name
        for law in build_discrepancies(around(force=0.0), FEATURES)
        if law.location
    ]
    assert unloaded == 7 * [OWN, NEIGHBOURS, TIME]


@EVERY
def test_it_displaces_its_coordinates_by_about_its_size_in_any_state_each_in_its_own_way(
    law,
):
    location, name = law
    states = around(400)
    size = JOINT_RAD if location else BASE_M if "shift" in name else BASE_RAD
    mine = (
        [3]
        if location
        else states.sites.base[:3]
        if "shift" in name
        else states.sites.base[3:]
    )
    mine = [states.sites.base["xyz".index(name[-1])]] if name[-2:-1] == " " else mine
    by_coordinate = {coordinate: np.zeros((0, 400)) for coordinate in mine}
    for made in displacements(states, law):
        ((coordinate, values),) = made.items()
        by_coordinate[coordinate] = np.vstack([by_coordinate[coordinate], values])
    each = list(by_coordinate.values())
    assert len(by_coordinate) == len(mine) and [len(found) for found in each] == [
        FEATURES if location else 6
    ] * len(mine)
    for found in each:
        squares = (found**2).sum(axis=0)
        assert (
            0.01 * size**2 < squares.mean() < 1.5 * size**2
            and squares.max() < 8 * size**2
        )
    assert all(np.abs(one - other).max() > 0.1 * size for one, other in pairwise(each))


@EVERY
def test_no_law_has_a_part_that_the_catalogue_has_a_name_for(law):
    """A zero offset, a compliance, a transmission ratio; what time brings a joint
    begins at nothing, a place may shift all."""
    location, name = law
    states = around()
    found = waves(displacements(states, law))
    if UNDER_LOAD in name:
        found = found / states.total[:, 3]
    free = found if location else found[:3]
    size = np.abs(free).max()
    begins = location and name.startswith(TIME)
    constant = np.abs(
        free[:, np.argmin(states.progress)] if begins else free.mean(axis=1)
    ).max()
    assert constant > 0.1 * size if name.startswith(PLACE) else constant < 1e-9 * size
    straight = np.abs(
        free @ (states.joint_angles[:, 3] - states.joint_angles[:, 3].mean())
    ).max()
    if location and not name.startswith(TIME):
        # The compliance may go straight with the angle: a cable that grows longer as it
        # winds has no name.
        assert straight > size if UNDER_LOAD in name else straight < 1e-7 * size


# What each law may depend on beside the load: everything else may change and it stays
# as it is.
CHANGED = {
    "the joint's own angle": lambda states: replace(
        states, joint_angles=states.joint_angles + 0.3 * np.eye(7)[3]
    ),
    "the angle beside": lambda states: replace(
        states, joint_angles=states.joint_angles + 0.3 * np.eye(7)[4]
    ),
    "an angle further off": lambda states: replace(
        states, joint_angles=states.joint_angles + 0.3 * np.eye(7)[6]
    ),
    "its approach": lambda states: replace(
        states, approach=states.approach * np.where(np.arange(7) == 3, -1.0, 1.0)
    ),
    "the time": lambda states: replace(states, time_s=states.time_s[::-1].copy()),
    "the temperature": lambda states: replace(
        states, temperature_c=states.temperature_c[::-1].copy()
    ),
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
    """Unloaded, or the load of a joint would change with the angles; the force on the
    base does not."""
    states = around(force=500.0 if law == FORCE else 0.0)
    moved = CHANGED[what](states)
    chosen = ((joint,), law) if joint else ((), f"{law} shift")
    one, other = (
        waves(displacements(each, chosen, states)) for each in (states, moved)
    )
    assert (np.abs(one - other).max() > 0.02 * min(JOINT_RAD, BASE_M)) == (
        what in DEPENDS[joint, law]
    )
