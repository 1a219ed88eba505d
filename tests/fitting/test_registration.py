"""Registration: frames and targets from nothing but measurements."""

from dataclasses import replace

import numpy as np
import pytest
from support import chain_of
from synthetic import made_estimate, made_model, made_states, seen_exactly

from elastocal.campaigns.campaign import Target
from elastocal.fitting.least_squares import registered

KNOWN_M, KNOWN_RAD = 1e-6, 1e-6
TWO = (Target("A", "6DoF", None), Target("B", "3DoF", None))


def unloaded(states):
    states.wrench[:] = 0.0
    return states


def assert_known(found, true, rows=3):
    for name in ("frame_position", "target_offset"):
        np.testing.assert_allclose(getattr(found, name), getattr(true, name), rtol=0, atol=KNOWN_M)
    np.testing.assert_allclose(found.frame_rotation, true.frame_rotation, rtol=0, atol=KNOWN_RAD)
    if rows == 6:
        np.testing.assert_allclose(found.target_rotation, true.target_rotation, rtol=0, atol=KNOWN_RAD)


@pytest.mark.parametrize("rows", [3, 6])
@pytest.mark.parametrize("sessions", [(0,), (2, 5)])
@pytest.mark.parametrize("targets", [TWO[:1], TWO], ids=["one target", "two targets"])
def test_frames_and_targets_are_found(fanuc, rows, sessions, targets):
    model = made_model(fanuc.chain, targets, rows)
    states = unloaded(made_states(6, 40, seed=1, sessions=len(sessions)))
    states.session[:] = np.array(sessions)[states.session]
    true = made_estimate(model, sessions, seed=2)
    found = registered(model, seen_exactly(model, true, states))
    assert found.sessions == sessions
    assert_known(found, true, rows)


def test_a_known_mount_keeps_its_turn_and_an_unknown_one_is_found(fanuc):
    targets = (Target("A", "6DoF", None, (0.1, -1.5, 0.2)), Target("B", "4DoF", (0.1, 0.0, 0.2), None))
    for fitted_frames in (False, True):
        model = made_model(fanuc.chain, targets, rows=6, fitted_frames=fitted_frames)
        states, true = unloaded(made_states(6, 15, seed=7)), made_estimate(model, seed=8)
        found = registered(model, seen_exactly(model, true, states))
        assert_known(found, true)
        np.testing.assert_allclose(found.target_rotation, true.target_rotation, atol=1e-7)
        np.testing.assert_array_equal(found.target_offset[1], (0.1, 0.0, 0.2))


def test_frame_is_no_reflection_where_all_points_lie_in_a_plane():
    chain = chain_of("Tz(0.3) Rz(q1) Tx(0.5) Rz(q2) Tx(0.5) [end]")
    model = made_model(chain, (Target("A", "end", (0.0, 0.0, 0.0)),))
    for seed in range(8):
        states, true = unloaded(made_states(2, 20, seed=seed)), made_estimate(model, seed=seed + 10)
        found = registered(model, seen_exactly(model, true, states))
        np.testing.assert_allclose(np.linalg.det(found.frame_rotation), 1.0)
        assert_known(found, true)


def test_a_target_without_a_measurement_stays_where_it_was(fanuc):
    """All of its measurements may be held out."""
    model = made_model(fanuc.chain, TWO, 6)
    states = unloaded(made_states(6, 40, seed=1))
    true = made_estimate(model, seed=2)
    seen = seen_exactly(model, true, states)
    first = seen.target == 0
    one = replace(
        seen, state=seen.state[first], target=seen.target[first], position=seen.position[first], rotation=seen.rotation[first]
    )
    found = registered(model, one)
    np.testing.assert_allclose(found.target_offset[0], true.target_offset[0], rtol=0, atol=KNOWN_M)
    np.testing.assert_array_equal(found.target_offset[1], 0.0)
