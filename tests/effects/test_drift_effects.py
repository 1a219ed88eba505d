"""Drift with time and temperature: by rigid motions and by chains that have grown."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support import OTHER_CHAINS, chain_of
from synthetic import (
    NOISE,
    candidate_on,
    conditions_on,
    displacements,
    made_estimate,
    made_model,
    made_states,
    seen_exactly,
    with_noise,
)

from elastocal.campaigns.campaign import Target
from elastocal.effects.catalogue import candidates_on
from elastocal.fitting.displacement import conditions
from elastocal.fitting.least_squares import fit
from elastocal.fitting.prediction import predict
from elastocal.mechanics.kinematics import poses

CHAINS = ["fanuc", "ur10", "fixed rotations"]


def predicted(chain, key, values, states, shapes=()):
    target = (Target("A", chain.end_effector.name, (0.0, 0.0, 0.0)),)
    effects = (candidate_on(chain, key),)
    model = made_model(chain, target, 6, fitted_frames=False, compliance=np.zeros(chain.coordinates), effects=effects)
    estimate = replace(made_estimate(model), coefficients=(np.array(values, float),), shapes=(np.array(shapes, float),))
    return predict(model, estimate, seen_exactly(model, estimate, states), conditions(model, estimate, states))


def grown(chain, share):
    """The chain with all lengths longer by a share, the column's too."""
    larger = [replace(t, constant=t.constant * (1 + share)) if t.kind == "T" else t for t in chain.transforms]
    return replace(chain, transforms=tuple(larger))


def assert_grown(chain, found, states, shares):
    for index, share in enumerate(shares):
        other = grown(chain, share)
        position, rotation = poses(other, states.joint_angles[index], other.end_effector)
        np.testing.assert_allclose(found[0][index], position, rtol=0, atol=1e-14)
        np.testing.assert_allclose(found[1][index], rotation, rtol=0, atol=1e-14)


@pytest.mark.parametrize("name", CHAINS)
def test_links_grow_with_the_temperature(name, fanuc):
    chain = fanuc.chain if name == "fanuc" else chain_of(OTHER_CHAINS[name])
    states = made_states(chain.coordinates, 5, seed=1)
    found = predicted(chain, "thermal_growth[temperature]", [2e-3], states)
    assert_grown(chain, found, states, 2e-3 * (states.temperature_c - 20.0))


@pytest.mark.parametrize("name", CHAINS)
@pytest.mark.parametrize("lag", [600.0, 7200.0])
def test_links_grow_with_the_time_by_a_lag(name, lag, fanuc):
    chain = fanuc.chain if name == "fanuc" else chain_of(OTHER_CHAINS[name])
    states = made_states(chain.coordinates, 5, seed=2)
    found = predicted(chain, "thermal_growth[time]", [1e-3], states, [lag])
    assert_grown(chain, found, states, 1e-3 * (1 - np.exp(-states.time_s / lag)))


def test_frame_drifts_by_a_rigid_motion_in_proportion_to_the_time(fanuc):
    states = made_states(6, 5, seed=3)
    rates = np.array([1e-4, -2e-4, 3e-4, 2e-4, 0.0, 0.0])
    position, rotation = predicted(fanuc.chain, "frame_drift", rates, states)
    bare = poses(fanuc.chain, states.joint_angles, fanuc.chain.end_effector)
    hours = states.time_s / 3600
    turn = Rotation.from_rotvec(hours[:, None] * rates[3:])
    np.testing.assert_allclose(position, turn.apply(bare[0]) + hours[:, None] * rates[:3], rtol=0, atol=1e-14)
    np.testing.assert_allclose(rotation, turn.as_matrix() @ bare[1], rtol=0, atol=1e-14)


def test_frame_drift_is_zero_when_the_time_begins_in_any_order(fanuc):
    states = made_states(6, 5, seed=4)
    states.time_s[:] = states.time_s[[3, 1, 0, 4, 2]] - states.time_s.min()
    made = displacements(candidate_on(fanuc.chain, "frame_drift"), conditions_on(fanuc.chain, states))
    assert not made[:, 2].any() and made[:, [0, 1, 3, 4]].any(axis=(0, 2)).all()


@pytest.mark.parametrize("key", ["thermal_growth[temperature]", "thermal_growth[time]", "frame_drift"])
def test_drift_of_a_state_does_not_hang_on_the_other_states(key, fanuc):
    whole, kept = made_states(6, 12, seed=5), np.arange(12) > 4
    part = type(whole)(**{name: value[kept] for name, value in vars(whole).items()})
    candidate = candidate_on(fanuc.chain, key)
    start = [shape.start for shape in candidate.shapes]
    expected = displacements(candidate, conditions_on(fanuc.chain, whole), *start)[:, kept]
    found = displacements(candidate, conditions_on(fanuc.chain, part), *start)
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-12)


def test_drift_needs_its_covariate(fanuc):
    known = candidates_on(conditions_on(fanuc.chain, made_states(6, 2)).sites)
    needs = {key: candidate.needs for key, candidate in known.items() if candidate.family == "drift"}
    assert {key: need for key, need in needs.items() if "gradient" not in key} == {
        "thermal_growth[temperature]": {"temperature"},
        "thermal_growth[time]": {"time"},
        "frame_drift": {"time"},
        "setup_step": set(),
    }
    for key, need in needs.items():
        if "gradient" in key:
            assert need == {key.removesuffix("]").split("[")[1].split(" ")[-1]}, key


@pytest.mark.parametrize("name", CHAINS)
def test_positions_are_scaled_about_the_base_or_a_tracker_that_is_fitted(name, fanuc):
    chain = fanuc.chain if name == "fanuc" else chain_of(OTHER_CHAINS[name])
    states = made_states(chain.coordinates, 6, seed=11)
    position, rotation = predicted(chain, "tracker_scale", [1e-3], states)
    still = poses(chain, states.joint_angles, chain.end_effector)
    np.testing.assert_allclose(position, 1.001 * still[0], rtol=0, atol=1e-14)
    np.testing.assert_allclose(rotation, still[1], rtol=0, atol=1e-14)
    # About a tracker at p: the same but for a shift of all.
    tracker = np.array([3.0, -1.0, 0.5])
    about = tracker + 1.001 * (still[0] - tracker)
    np.testing.assert_allclose(about - position, np.broadcast_to(-1e-3 * tracker, (6, 3)), atol=1e-14)


def test_link_that_is_warmer_on_one_side_bends_to_an_arc():
    # Curvature k about z along x: the end is l^2 k / 2 to the side and turned by l k; an arc of a circle, to first order.
    chain = chain_of("Rz(q1) Tx(2) [end]")
    states = made_states(1, 3, seed=12)
    states.joint_angles[:] = 0.0
    warmer = states.temperature_c - 20.0
    candidate = candidate_on(chain, "temperature_gradient@1[temperature]")
    assert [p.name for p in candidate.parameters] == ["curvature_about_y", "curvature_about_z"]
    position, rotation = predicted(chain, "temperature_gradient@1[temperature]", [0.0, 1e-8], states)
    np.testing.assert_allclose(position[:, 1], 1e-8 * warmer * 2**2 / 2, rtol=1e-6)
    np.testing.assert_allclose(rotation[:, 1, 0], 1e-8 * warmer * 2, rtol=1e-6)
    position, rotation = predicted(chain, "temperature_gradient@1[temperature]", [1e-8, 0.0], states)
    np.testing.assert_allclose(position[:, 2], -1e-8 * warmer * 2**2 / 2, rtol=1e-6)
    np.testing.assert_allclose(-rotation[:, 2, 0], 1e-8 * warmer * 2, rtol=1e-6)


def test_links_bend_about_axes_square_to_them(fanuc):
    around = conditions_on(fanuc.chain, made_states(6, 3, seed=13))
    for link in (1, 2, 3, 6):
        made = displacements(candidate_on(fanuc.chain, f"temperature_gradient@{link}[time]"), around, 3600.0)
        shift, turn = np.split(made[..., list(around.sites.link_end[link])], 2, axis=-1)
        vector = around.sites.link_vectors_m[link]
        np.testing.assert_allclose(shift @ vector, 0.0, atol=1e-15)
        np.testing.assert_allclose(turn @ vector, 0.0, atol=1e-15)
        np.testing.assert_allclose(shift, np.cross(turn, vector) / 2, atol=1e-15)


def test_gradient_along_the_arm_makes_its_far_links_longer_and_not_the_arm():
    chain = chain_of("Tz(1) Rz(q1) Tx(2) Ry(q2) Tx(1) [end]")
    states = made_states(2, 3, seed=14)
    around = conditions_on(chain, states)
    made = displacements(candidate_on(chain, "temperature_gradient[along temperature]"), around)[0]
    warmer = states.temperature_c - 20.0
    # Middles at 0.5, 2 and 3.5 m, whose mean by length is 2 m: shares -1.5, 0 and 1.5.
    ends = around.sites.link_end
    np.testing.assert_allclose(made[:, ends[0][2]], -1.5 * warmer * 1.0)
    np.testing.assert_allclose(made[:, ends[1][0]], 0.0, atol=1e-14)
    np.testing.assert_allclose(made[:, ends[2][0]], 1.5 * warmer * 1.0)


def test_setup_that_is_moved_between_two_rows_moves_all_measurements_from_there_on(fanuc):
    states = made_states(6, 11, seed=15)
    states.row[:] = 5 * np.arange(11) + 3
    step = np.array([1e-3, 0.0, -2e-3, 0.0, 1e-4, 0.0])
    position, rotation = predicted(fanuc.chain, "setup_step", step, states, [0.42])
    still = poses(fanuc.chain, states.joint_angles, fanuc.chain.end_effector)
    turn = Rotation.from_rotvec(step[3:])
    np.testing.assert_allclose(position[:5], still[0][:5], rtol=0, atol=1e-14)
    np.testing.assert_allclose(position[5:], turn.apply(still[0][5:]) + step[:3], rtol=0, atol=1e-14)
    np.testing.assert_allclose(rotation[5:], turn.as_matrix() @ still[1][5:], rtol=0, atol=1e-14)


# Between two of the values that are tried, nearer to the second.
SPACING, WHEN = 1 / 12, 0.655


def test_steps_are_tried_at_every_twelfth_of_a_campaign_but_its_ends(fanuc):
    """None of them a shift of all measurements but a few; the one nearest to a step has all but a 24th on the right side."""
    (when,) = candidate_on(fanuc.chain, "setup_step").shapes
    np.testing.assert_allclose(when.values(3), np.arange(1, 12) / 12)
    assert (when.lowest, when.highest) == pytest.approx((1 / 12, 11 / 12))


def test_moved_setup_is_found_without_a_clock(fanuc):
    """A step of 0.3 mm in the middle of 40 measurements is fitted where it is, and leaves a misfit where it is not.

    Of the values that are tried the nearest is as good as the true one but for the measurement between them.
    """
    candidate = candidate_on(fanuc.chain, "setup_step")
    model = made_model(fanuc.chain, compliance=fanuc.compliance, effects=(candidate,))
    true = replace(made_estimate(model, seed=17), coefficients=(np.array([3e-4, 0, 0, 0, 0, 0]),), shapes=(np.array([WHEN]),))
    states = replace(made_states(6, 40, seed=18), time_s=None)
    seen = with_noise(seen_exactly(model, true, states), np.random.default_rng(19), position_m=20e-6)
    noise = replace(NOISE, position_m=20e-6)
    misfit = []
    for when in candidate.shapes[0].values(3):
        start = replace(true, coefficients=(np.zeros(6),), shapes=(np.array([when]),))
        found = fit(model, seen, noise, start)
        misfit.append((found.whitened(found.residual) ** 2).sum())
        if abs(when - WHEN) < SPACING / 2:
            deviation = np.sqrt(found.covariance[-7, -7])
            assert abs(found.estimate.coefficients[0][0] - 3e-4) < 4 * deviation < 1e-4
    best = candidate.shapes[0].values(3)[int(np.argmin(misfit))]
    assert abs(best - WHEN) < SPACING / 2 and np.median(misfit) > min(misfit) + 100
