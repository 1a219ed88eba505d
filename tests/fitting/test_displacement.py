"""Where the robot yields to, by scipy's root finder and by hand."""

from dataclasses import replace

import numpy as np
import pytest
from fitted_models import TARGETS, model_of
from planted import two_loads_a_pose
from scipy.optimize import root
from synthetic import NOISE, made_estimate, made_model, made_states, seen_exactly, with_noise

from elastocal.campaigns.campaign import Target
from elastocal.effects.catalogue import candidates_on
from elastocal.fitting.least_squares import fit
from elastocal.fitting.prediction import conditions, displaced_coordinates, predict
from elastocal.mechanics.elastostatics import exact_deflections, joint_torques
from elastocal.mechanics.kinematics import poses


def equilibrium(chain, compliance, states, weighing=None):
    """Turn of each joint where the springs hold the load at the pose to which it has turned them, by scipy's root finder."""
    end = replace(chain.end_effector, offset_m=(0, 0, 0))

    def unbalanced(turned, q, wrench):
        torque = joint_torques(chain, q + turned, wrench, end)
        return turned - compliance * (torque if weighing is None else torque + weighing(q + turned))

    pairs = zip(states.joint_angles, states.wrench, strict=True)
    return np.array([root(unbalanced, np.zeros(len(q)), (q, wrench), tol=1e-15).x for q, wrench in pairs])


def test_nominal_springs_deflect_as_equation_9_with_exact_kinematics(fanuc):
    targets = tuple(Target(p.name, p.name, (0.05, 0.1, -0.1)) for p in fanuc.chain.points)
    model = made_model(fanuc.chain, targets, 6, fitted_frames=False, compliance=fanuc.compliance)
    estimate, states = made_estimate(model), made_states(6, 6, seed=4)
    seen = seen_exactly(model, estimate, states)
    position, rotation = predict(model, estimate, seen, conditions(model, estimate, states))
    turned = equilibrium(fanuc.chain, fanuc.compliance, states)
    for index, point in enumerate(fanuc.chain.points):
        target = replace(point, offset_m=(0.05, 0.1, -0.1))
        expected = poses(fanuc.chain, states.joint_angles + turned, target)
        np.testing.assert_allclose(position[seen.target == index], expected[0], rtol=0, atol=1e-9)
        np.testing.assert_allclose(rotation[seen.target == index], expected[1], rtol=0, atol=1e-9)
    bent = exact_deflections(fanuc.chain, states.joint_angles, turned, fanuc.chain.end_effector)
    assert np.abs(bent).max() > 1e-4


def test_effects_add_up_on_the_coordinates_of_the_sites(fanuc):
    known = candidates_on(made_model(fanuc.chain).sites)
    offset, growth, frame = (known[key] for key in ("joint_offset@2", "stiffening@2", "base_compliance"))
    model = made_model(fanuc.chain, compliance=fanuc.compliance, effects=(offset, growth, frame))
    estimate, states = made_estimate(model, seed=10), made_states(6, 5, seed=11)
    around = conditions(model, estimate, states)
    found = displaced_coordinates(model, estimate, around)
    torque = joint_torques(model.sites.chain, found, states.wrench, model.sites.chain.end_effector)[:, :6]
    expected = states.joint_angles + fanuc.compliance * torque
    (meeting,), load = estimate.shapes[1], torque[:, 1]
    beyond = load - meeting * np.tanh(load / meeting)
    expected[:, 1] += estimate.coefficients[0][0] + estimate.coefficients[1][0] * beyond
    np.testing.assert_allclose(found[:, :6], expected, rtol=0, atol=1e-9)
    at_base = found[:, list(model.sites.base)]
    np.testing.assert_allclose(at_base[:, :2], estimate.coefficients[2][0] * states.wrench[:, :2], rtol=1e-9, atol=1e-18)
    used = {*range(6), *model.sites.base}
    assert not np.delete(found, list(used), axis=1).any()


@pytest.mark.parametrize("joint_rad", [0.0, 2e-5])
def test_a_fit_of_more_states_than_are_kept_is_the_same_and_keeps_no_jacobian(fanuc, monkeypatch, joint_rad):
    model = model_of(fanuc, "joint_offset@3", "stiffening@2", targets=TARGETS)
    seen = with_noise(
        seen_exactly(model, made_estimate(model, seed=64), two_loads_a_pose(6, 20, seed=65)), np.random.default_rng(66)
    )
    noise = replace(NOISE, joint_rad=np.full(6, joint_rad))
    kept = fit(model, seen, noise)
    monkeypatch.setattr("elastocal.fitting.displacement._MOST_STATES", 10)
    monkeypatch.setattr("elastocal.fitting.displacement._MOST_AT_ONCE", 16)
    monkeypatch.setattr("elastocal.fitting.displacement._MOST_HELD", 16 * 180)
    found = fit(model, seen, noise)
    assert kept.joint_jacobian is not None and found.joint_jacobian is None and found.conditions is None
    deviation = np.sqrt(np.diag(kept.covariance))
    values = [np.concatenate(each.estimate.coefficients) for each in (kept, found)]
    assert (np.abs(values[0] - values[1]) < 2e-3 * deviation[-len(values[0]) :]).all()
    np.testing.assert_allclose(np.sqrt(np.diag(found.covariance)), deviation, rtol=1e-4)
    parts = [list(each.sensitivities(seen)) for each in (kept, found)]
    assert len(parts[1]) > 1
    for number in (1, 2):
        one, other = (np.concatenate([part[number] for part in each]) for each in parts)
        np.testing.assert_allclose(one, other, rtol=0, atol=1e-5 * np.abs(one).max())
