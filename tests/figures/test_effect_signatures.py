"""Signatures show what each effect depends on: the angle of its joint, the load, the approach or the time."""

import numpy as np
import pytest
from analysed_robots import analysed

from elastocal.effects.catalogue import effects
from elastocal.figures.effect_signatures import list_candidates, signature


@pytest.fixture(scope="module")
def arm():
    return analysed("gp180")


@pytest.mark.parametrize("name", effects())
def test_every_effect_of_the_catalogue_displaces_the_reflector_somewhere(name, arm):
    shown = signature(name, arm)
    moved = [shown.by_angle, shown.by_angle_loaded, shown.by_force, shown.by_force_falling, shown.by_time]
    assert all(np.isfinite(each).all() and each.shape[1] == 3 for each in moved)
    # By more than a tracker's noise and by less than would be seen without one.
    assert 5e-3 < max(np.abs(each).max() for each in moved) < 50
    assert shown.candidate.key in {candidate.key for candidate in list_candidates(name, arm)}


def test_an_offset_needs_neither_load_nor_time(arm):
    shown = signature("joint_offset", arm)
    assert shown.joint == 2 and shown.candidate.joints == (2,)
    np.testing.assert_allclose(shown.by_angle, shown.by_angle_loaded, atol=1e-12)
    for moved in (shown.by_force, shown.by_time):
        np.testing.assert_allclose(moved, moved[:1].repeat(len(moved), axis=0), atol=1e-12)
    # A milliradian about a lever of the arm, in mm.
    assert 1 < np.linalg.norm(shown.by_angle, axis=1).max() < 3.2


def test_a_spring_is_odd_in_the_load_and_does_nothing_without(arm):
    shown = signature("joint_tilt", arm)
    assert not shown.by_angle.any() and not shown.by_time.any() and shown.by_angle_loaded.any()
    np.testing.assert_allclose(shown.by_force, -shown.by_force[::-1], atol=1e-3)


def test_hysteresis_goes_by_the_side_from_which_a_joint_came(arm):
    shown = signature("hysteresis", arm)
    np.testing.assert_allclose(shown.by_force, -shown.by_force_falling, atol=1e-3)
    assert np.abs(shown.by_force).max() > 0.05


def test_a_drift_begins_at_nothing_and_a_step_happens_in_the_middle(arm):
    drift, step = signature("frame_drift", arm).by_time, signature("setup_step", arm).by_time
    assert not drift[0].any() and drift[-1].any()
    half = len(step) // 2
    assert not step[:half].any() and np.abs(step[half:]).max(axis=1).all()
