"""The creep of a stand against its closed form, and against the random walk that it
expands."""

from dataclasses import replace

import numpy as np
import pytest
from closed_forms import CHAINS, STATES, check_closed_form, six
from support import chain_of
from synthetic import displacements, equipped, make_states

from elastocal.effects.conditions import build_conditions
from elastocal.effects.stand_creep import stand_creep
from elastocal.mechanics.sites import PushedSession

# Share of the variance about the mean that the omitted terms may hold, and the largest
# part of a covariance: twice the sum of 1 / (k pi)^2 over k > 8 is 0.024.
OMITTED = 0.08
LARGEST_OMITTED = 0.025


def creep_at_the_foot(arm, law, name):
    axis, order = name.removeprefix("d").split("_")
    share = (arm.states.row - arm.states.row.min()) / np.ptp(arm.states.row)
    phase = int(order) * np.pi
    axes = np.broadcast_to(np.eye(3), (STATES, 3, 3))
    amount = np.sqrt(2.0) / phase * np.cos(phase * share)
    return six(arm, 0, axes, f"d{axis}", amount)


@pytest.mark.parametrize("chain_name", CHAINS)
def test_stand_moves_by_cosines_of_the_share_of_its_session(chain_name):
    check_closed_form(stand_creep.candidates, creep_at_the_foot, chain_name)


def creep_on_rows(pushed, rows, sessions):
    """Displacement (D, S) along x of each parameter of a candidate, at some rows."""
    sites = replace(
        equipped(chain_of("Rz(q1) Tx(1) [1DoF]")), pushed_sessions=(pushed,)
    )
    states = replace(
        make_states(1, len(rows)), row=np.array(rows), session=np.array(sessions)
    )
    conditions = build_conditions(sites, np.array([1e-6]), states)
    (candidate,) = stand_creep.candidates(sites)
    return displacements(candidate, conditions)[:, :, sites.base[0]]


def test_displacements_have_the_covariance_of_a_random_walk_about_its_mean():
    rows = np.arange(101)
    along_x = creep_on_rows(PushedSession(0, 0.0, 1.0), rows, 0 * rows)
    share = rows / 100
    walk = np.minimum.outer(share, share)
    centring = np.eye(101) - np.full((101, 101), 1 / 101)
    expected = centring @ walk @ centring
    actual = along_x.T @ along_x
    error = np.trace(expected - actual) / np.trace(expected)
    assert 0.0 < error < OMITTED
    np.testing.assert_allclose(actual, expected, atol=LARGEST_OMITTED)


def test_other_sessions_stand_still_and_the_end_of_a_session_keeps_its_place():
    rows = [0, 10, 20, 30, 40, 50]
    sessions = [0, 1, 1, 1, 1, 2]
    # The fitted rows of the session are 10 to 30; row 40 of it is held out.
    along_x = creep_on_rows(PushedSession(1, 0.2, 0.6), rows, sessions)
    np.testing.assert_array_equal(along_x[:, [0, 5]], 0.0)
    assert np.abs(along_x[:, 1:4]).max(axis=0).min() > 0.1
    np.testing.assert_allclose(along_x[:, 4], along_x[:, 3])
    np.testing.assert_allclose(along_x[3, [1, 2, 3]], [0.225, -0.225, 0.225], atol=1e-3)
