"""Places, limits and kinds that `elastocal plan` reads, and what it refuses."""

import numpy as np
import pytest

from elastocal.campaigns.campaign import Target
from elastocal.command.plan_places import PlaceOptions, read_kind, read_setup
from elastocal.errors import InputError


def read(robot, kind, places=(), limits=(), tracker=None, targets=None):
    """Read the set-up of a robot whose end effector has one target by default."""
    if targets is None:
        targets = [Target("tip", robot.chain.end_effector.name, (0.0, 0.0, 0.1))]
    options = PlaceOptions(kind, places, limits, "on-robot")
    return read_setup(options, tracker or {}, robot, targets)


def test_a_tracker_has_no_set_up(kuka):
    assert read(kuka, "pose") is None


def test_places_are_numbers_and_directions_have_length_one(kuka):
    setup = read(kuka, "plane", ["floor=1,2,3,0,0,2", "wall=0,0,0,3,0,4"])
    assert list(setup.places) == ["floor", "wall"]
    np.testing.assert_allclose(setup.places["floor"], [1, 2, 3, 0, 0, 1])
    np.testing.assert_allclose(setup.places["wall"][3:], [0.6, 0.0, 0.8])


def test_a_stated_limit_replaces_that_of_the_kind(kuka):
    usual = read(kuka, "board", ["board=1,0,0.2"])
    name, value = next(iter(usual.kind.limits.items()))
    stated = read(kuka, "board", ["board=1,0,0.2"], [f"{name}={0.5 * value}"])
    assert usual.options[name] == value
    assert stated.options[name] == 0.5 * value


@pytest.mark.parametrize(
    ("kind", "places", "limits", "tracker", "option"),
    [
        ("pose", ["floor=0,0,0"], [], {}, "--place"),
        ("point", ["socket=1,0,0"], [], {"--force": 100.0}, "--force"),
        ("point", [], [], {}, "--place"),
        ("point", ["socket=1,0"], [], {}, "--place"),
        ("point", ["socket=1,0,nan"], [], {}, "--place"),
        ("point", ["=1,0,0"], [], {}, "--place"),
        ("plane", ["floor=0,0,0,0,0,0"], [], {}, "--place"),
        ("board", ["a=1,0,0", "b=0,1,0"], [], {}, "--place"),
        ("board", ["a=1,0,0"], ["farthest=1"], {}, "--limit"),
    ],
)
def test_a_wrong_option_is_refused_by_its_name(
    kuka, kind, places, limits, tracker, option
):
    with pytest.raises(InputError) as refusal:
        read(kuka, kind, places, limits, tracker)
    assert str(refusal.value).startswith(option)


def test_a_contact_measures_one_target(kuka):
    targets = [Target(name, kuka.chain.end_effector.name, None) for name in "AB"]
    with pytest.raises(InputError, match="2 targets"):
        read(kuka, "point", ["socket=1,0,0"], targets=targets)


def test_a_kind_without_plans_is_refused():
    with pytest.raises(InputError, match="no plans"):
        read_kind("relative")
