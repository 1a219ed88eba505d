"""Signatures show what each effect depends on: the angle of its joint, the load, the
approach or the time."""

import numpy as np
import pytest
from analysed_robots import analysed

from elastocal.effects.catalogue import list_bundled_effects
from elastocal.figures.effect_signatures import compute_signature, list_candidates


@pytest.fixture(scope="module")
def arm():
    return analysed("gp180")


@pytest.mark.parametrize("name", list_bundled_effects())
def test_every_effect_of_the_catalogue_displaces_the_reflector_somewhere(name, arm):
    shown = compute_signature(name, arm)
    displacements = shown.displacement_mm.values()
    assert all(
        np.isfinite(displacement).all() and displacement.shape[1] == 3
        for displacement in displacements
    )
    # The displacement exceeds a tracker's noise but is too small to see by eye.
    assert 5e-3 < max(np.abs(displacement).max() for displacement in displacements) < 50
    assert shown.candidate.key in {
        candidate.key for candidate in list_candidates(name, arm)
    }


def test_a_drift_begins_at_nothing_and_a_step_happens_in_the_middle(arm):
    drift = compute_signature("frame_drift", arm).displacement_mm["by time"]
    step = compute_signature("setup_step", arm).displacement_mm["by time"]
    assert not drift[0].any() and drift[-1].any()
    half = len(step) // 2
    assert not step[:half].any() and np.abs(step[half:]).max(axis=1).all()
