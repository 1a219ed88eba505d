"""Drift with time and temperature: by rigid motions and by chains that have grown."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support import OTHER_CHAINS, chain_of
from synthetic import candidate_on, circumstances_on, displacements, made_estimate, made_model, made_states, seen_exactly

from elastocal.campaign import Target
from elastocal.effects.catalogue import candidates_on
from elastocal.kinematics import poses
from elastocal.model import circumstances, predict

CHAINS = ["fanuc", "ur10", "fixed rotations"]


def predicted(chain, key, values, states, shapes=()):
    target = (Target("A", chain.end_effector.name, (0.0, 0.0, 0.0)),)
    effects = (candidate_on(chain, key),)
    model = made_model(chain, target, 6, fitted_frames=False, compliance=np.zeros(chain.coordinates), effects=effects)
    estimate = replace(made_estimate(model), coefficients=(np.array(values, float),), shapes=(np.array(shapes, float),))
    return predict(model, estimate, seen_exactly(model, estimate, states), circumstances(model, estimate, states))


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
    made = displacements(candidate_on(fanuc.chain, "frame_drift"), circumstances_on(fanuc.chain, states))
    assert not made[:, 2].any() and made[:, [0, 1, 3, 4]].any(axis=(0, 2)).all()


@pytest.mark.parametrize("key", ["thermal_growth[temperature]", "thermal_growth[time]", "frame_drift"])
def test_drift_of_a_state_does_not_hang_on_the_other_states(key, fanuc):
    whole, kept = made_states(6, 12, seed=5), np.arange(12) > 4
    part = type(whole)(**{name: value[kept] for name, value in vars(whole).items()})
    candidate = candidate_on(fanuc.chain, key)
    start = [shape.start for shape in candidate.shapes]
    expected = displacements(candidate, circumstances_on(fanuc.chain, whole), *start)[:, kept]
    found = displacements(candidate, circumstances_on(fanuc.chain, part), *start)
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-12)


def test_drift_needs_its_covariate(fanuc):
    known = candidates_on(circumstances_on(fanuc.chain, made_states(6, 2)).sites)
    needs = {key: candidate.needs for key, candidate in known.items() if candidate.family == "drift"}
    assert needs == {"thermal_growth[temperature]": {"temperature"}, "thermal_growth[time]": {"time"}, "frame_drift": {"time"}}
