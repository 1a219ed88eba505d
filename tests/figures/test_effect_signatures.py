"""Signatures show what each effect depends on: the angle of its joint, the load, the approach or the time."""

import numpy as np
import pytest
from analysed_robots import analysed

from elastocal.effects.catalogue import effects
from elastocal.figures.effect_signatures import list_candidates, signature


@pytest.fixture(scope="module")
def arm():
    return analysed("gp180")


# The robot of the figures declares no masses.
@pytest.mark.parametrize("name", sorted({*effects()} - {"declared_masses"}))
def test_every_effect_of_the_catalogue_displaces_the_reflector_somewhere(name, arm):
    shown = signature(name, arm)
    moved = shown.moved.values()
    assert all(np.isfinite(each).all() and each.shape[1] == 3 for each in moved)
    # By more than a tracker's noise and by less than would be seen without one.
    assert 5e-3 < max(np.abs(each).max() for each in moved) < 50
    assert shown.candidate.key in {candidate.key for candidate in list_candidates(name, arm)}


def test_an_offset_needs_neither_load_nor_time(arm):
    shown = signature("joint_offset", arm)
    assert shown.joint == 2 and shown.candidate.joints == (2,)
    np.testing.assert_allclose(shown.moved["by angle"], shown.moved["by angle, loaded"], atol=1e-12)
    for moved in (shown.moved["by force"], shown.moved["by time"]):
        np.testing.assert_allclose(moved, moved[:1].repeat(len(moved), axis=0), atol=1e-12)
    # A milliradian about a lever of the arm, in mm.
    assert 1 < np.linalg.norm(shown.moved["by angle"], axis=1).max() < 3.2


def test_a_spring_is_odd_in_the_load_and_does_nothing_without(arm):
    shown = signature("joint_tilt", arm)
    assert not shown.moved["by angle"].any() and not shown.moved["by time"].any() and shown.moved["by angle, loaded"].any()
    np.testing.assert_allclose(shown.moved["by force"], -shown.moved["by force"][::-1], atol=1e-3)


def test_hysteresis_goes_by_the_side_from_which_a_joint_came(arm):
    shown = signature("hysteresis", arm)
    np.testing.assert_allclose(shown.moved["by force"], -shown.moved["by force, falling"], atol=1e-3)
    assert np.abs(shown.moved["by force"]).max() > 0.05


def test_a_drift_begins_at_nothing_and_a_step_happens_in_the_middle(arm):
    drift, step = signature("frame_drift", arm).moved["by time"], signature("setup_step", arm).moved["by time"]
    assert not drift[0].any() and drift[-1].any()
    half = len(step) // 2
    assert not step[:half].any() and np.abs(step[half:]).max(axis=1).all()
