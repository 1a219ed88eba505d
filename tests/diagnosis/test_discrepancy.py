"""Discrepancies depend on the inputs of one cause, and contain nothing that the
catalogue names."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from support import SEVEN_JOINTS, robot_of
from synthetic import conditions_on, make_states

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
BASE_FEATURES = 6
JOINT_NAMES = [
    f"{cause}{load}" for cause in (OWN, NEIGHBOURS, TIME) for load in ("", UNDER_LOAD)
]
BASE_NAMES = [
    f"{FORCE} shift",
    f"{FORCE} turn",
    f"{TIME} shift",
    f"{TIME} turn",
    f"{PLACE} shift x",
    f"{PLACE} shift y",
    f"{PLACE} shift z",
    f"{PLACE} turn",
]
# Joint and name of each discrepancy of joint 4 and of the base (joint 0).
DISCREPANCIES = [(4, name) for name in JOINT_NAMES] + [(0, name) for name in BASE_NAMES]
EVERY_DISCREPANCY = pytest.mark.parametrize(("joint", "name"), DISCREPANCIES)


def conditions_of_seven_joints(count=60, force=500.0):
    states = make_states(7, count, seed=1, force=force)
    return conditions_on(robot_of(SEVEN_JOINTS), states)


def displacements_by(joint, name, conditions, campaign=None):
    """Displaced coordinates and displacements (features, S) of one discrepancy, drawn
    for a campaign."""
    location = (joint,) if joint else ()
    (discrepancy,) = (
        candidate
        for candidate in build_discrepancies(campaign or conditions, FEATURES)
        if (candidate.location, candidate.name) == (location, name)
    )
    coordinates = []
    values = []
    for displacement in discrepancy.displacement(conditions):
        ((coordinate, value),) = displacement.items()
        coordinates.append(coordinate)
        values.append(value)
    return np.array(coordinates), np.array(values)


def test_discrepancies_act_by_every_cause_at_every_joint_and_at_the_base():
    discrepancies = build_discrepancies(conditions_of_seven_joints(), FEATURES)
    at_joints = [((joint,), name) for joint in range(1, 8) for name in JOINT_NAMES]
    at_base = [((), name) for name in BASE_NAMES]
    assert [(d.location, d.name) for d in discrepancies] == at_joints + at_base


def test_a_joint_without_a_load_has_no_discrepancy_in_proportion_to_it():
    unloaded = build_discrepancies(conditions_of_seven_joints(force=0.0), FEATURES)
    names = [discrepancy.name for discrepancy in unloaded if discrepancy.location]
    assert names == 7 * [OWN, NEIGHBOURS, TIME]


def expected_coordinates(joint, name, base):
    if joint:
        return [joint - 1]
    if name.startswith(f"{PLACE} shift"):
        return [base["xyz".index(name[-1])]]
    return list(base[:3] if "shift" in name else base[3:])


def expected_size(joint, name):
    if joint:
        return JOINT_RAD
    return BASE_M if "shift" in name else BASE_RAD


@EVERY_DISCREPANCY
def test_each_coordinate_is_displaced_by_about_the_size_and_differently_from_the_others(
    joint, name
):
    states = conditions_of_seven_joints(400)
    coordinates, values = displacements_by(joint, name, states)
    expected = expected_coordinates(joint, name, states.sites.base)
    assert set(coordinates) == set(expected)
    size = expected_size(joint, name)
    by_coordinate = [values[coordinates == coordinate] for coordinate in expected]
    for of_coordinate in by_coordinate:
        assert len(of_coordinate) == (FEATURES if joint else BASE_FEATURES)
        squares = (of_coordinate**2).sum(axis=0)
        assert 0.01 * size**2 < squares.mean() < 1.5 * size**2
        assert squares.max() < 8 * size**2
    for first, second in pairwise(by_coordinate):
        assert np.abs(first - second).max() > 0.1 * size


@EVERY_DISCREPANCY
def test_no_discrepancy_has_a_constant_part_that_the_catalogue_names(joint, name):
    """A zero offset or a compliance has none; what time brings a joint begins at zero,
    and a discrepancy with the position may shift all targets."""
    states = conditions_of_seven_joints()
    functions = plain_functions(joint, name, states)
    size = np.abs(functions).max()
    constant = functions.mean(axis=1)
    if joint and name.startswith(TIME):
        constant = functions[:, np.argmin(states.progress)]
    largest = np.abs(constant).max()
    if name.startswith(PLACE):
        assert largest > 0.1 * size
    else:
        assert largest < 1e-9 * size


@pytest.mark.parametrize("name", [n for n in JOINT_NAMES if not n.startswith(TIME)])
def test_a_joint_has_no_linear_part_without_a_load_because_that_is_a_ratio(name):
    """The compliance may change linearly with the angle: a cable that grows longer as
    it winds is not in the catalogue."""
    states = conditions_of_seven_joints()
    functions = plain_functions(4, name, states)
    size = np.abs(functions).max()
    angle = states.joint_angles[:, 3]
    linear = np.abs(functions @ (angle - angle.mean())).max()
    if UNDER_LOAD in name:
        assert linear > size
    else:
        assert linear < 1e-7 * size


def plain_functions(joint, name, states):
    """Functions of one discrepancy, divided by the load if they are in proportion to
    it; at the base those without the load, which come first."""
    _, values = displacements_by(joint, name, states)
    if UNDER_LOAD in name:
        values = values / states.total[:, 3]
    return values if joint else values[:3]


# What a discrepancy may depend on besides the load, and states in which it differs.
CHANGES = {
    "the joint's own angle": lambda states: replace(
        states, joint_angles=states.joint_angles + 0.3 * np.eye(7)[3]
    ),
    "the neighbouring angle": lambda states: replace(
        states, joint_angles=states.joint_angles + 0.3 * np.eye(7)[4]
    ),
    "a distant angle": lambda states: replace(
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
DEPENDENCIES = {
    (4, OWN): {"the joint's own angle", "its approach"},
    (4, NEIGHBOURS): {"the joint's own angle", "the neighbouring angle"},
    (4, TIME): {"the time", "the temperature", "the row"},
    (0, TIME): {"the time", "the temperature", "the row"},
    (0, FORCE): set(),
}


@pytest.mark.parametrize("change", CHANGES)
@pytest.mark.parametrize(("joint", "cause"), DEPENDENCIES)
def test_a_discrepancy_depends_on_its_own_cause_alone(joint, cause, change):
    """The robot is unloaded, because the load of a joint would change with the angles;
    the force on the base does not."""
    states = conditions_of_seven_joints(force=500.0 if cause == FORCE else 0.0)
    name = cause if joint else f"{cause} shift"
    _, before = displacements_by(joint, name, states, states)
    _, after = displacements_by(joint, name, CHANGES[change](states), states)
    differs = np.abs(before - after).max() > 0.02 * min(JOINT_RAD, BASE_M)
    assert differs == (change in DEPENDENCIES[joint, cause])
