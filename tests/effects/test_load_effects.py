"""Errors of the load: the same as the joint springs under the wrench that really acts."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support import OTHER_CHAINS, PinocchioPoint, chain_of
from synthetic import candidate_on, conditions_on, displacements, made_states

COMPLIANCE = 1e-6 * np.array([1.0, 2.0, 3.0, 4.0, 5.0, 6.0])


@pytest.fixture(params=["fanuc", "ur10", "fixed rotations"])
def case(request, fanuc):
    """Chain, states, and a function from a wrench in each state to the turn of the joints, by pinocchio."""
    chain = fanuc.chain if request.param == "fanuc" else chain_of(OTHER_CHAINS[request.param])
    states = made_states(chain.coordinates, 5, seed=1)
    model = PinocchioPoint(chain, replace(chain.end_effector, offset_m=(0.0, 0.0, 0.0)))
    seen = [model.pose_and_jacobian(q) for q in states.joint_angles]
    jacobians, flange = np.array([j for _, _, j in seen]), np.array([r for _, r, _ in seen])

    def turned(wrench):
        return np.einsum("srn,sr->sn", jacobians, wrench) * COMPLIANCE[: chain.coordinates]

    return chain, states, flange, turned


def made_by(chain, key, values, states):
    made = displacements(candidate_on(chain, key), conditions_on(chain, states, COMPLIANCE[: chain.coordinates]))
    assert not made[:, :, chain.coordinates :].any()
    return np.tensordot(values, made, axes=1)[:, : chain.coordinates]


def direction(frame, flange, values):
    """A vector that is fixed in the base or in the flange, in base axes in each state."""
    return flange @ values if frame == "flange axes" else np.tile(values, (len(flange), 1))


def assert_made_by_the_change(found, turned, wrench, changed):
    expected = turned(changed) - turned(wrench)
    np.testing.assert_allclose(
        found, expected, rtol=0, atol=1e-11 * np.abs(turned(wrench)).max() + 1e-8 * np.abs(expected).max()
    )
    assert np.abs(expected).max() > 0


def test_force_scale_is_the_deflection_under_a_wrench_that_is_larger(case):
    chain, states, _, turned = case
    assert_made_by_the_change(made_by(chain, "force_scale", [0.03], states), turned, states.wrench, 1.03 * states.wrench)


@pytest.mark.parametrize("frame", ["base axes", "flange axes"])
def test_force_bias_is_the_deflection_under_a_further_force(case, frame):
    chain, states, flange, turned = case
    bias = np.array([3.0, -7.0, 2.0])
    changed = states.wrench.copy()
    changed[:, :3] += direction(frame, flange, bias)
    assert_made_by_the_change(made_by(chain, f"force_bias[{frame}]", bias, states), turned, states.wrench, changed)


def test_force_bias_is_not_there_where_nothing_is_measured(fanuc):
    states = made_states(6, 5, seed=2)
    states.wrench[2] = 0.0
    found = made_by(fanuc.chain, "force_bias[base axes]", [1.0, 2.0, 3.0], states)
    np.testing.assert_array_equal(found.any(axis=1), [True, True, False, True, True])


@pytest.mark.parametrize("frame", ["base axes", "flange axes"])
def test_misaligned_force_is_the_force_turned_by_a_small_angle(case, frame):
    chain, states, flange, turned = case
    angle = 1e-8 * np.array([3.0, -7.0, 2.0])
    changed = states.wrench.copy()
    # The moment is the operator's own: only the force is turned.
    changed[:, :3] = Rotation.from_rotvec(direction(frame, flange, angle)).apply(states.wrench[:, :3])
    found = made_by(chain, f"force_misalignment[{frame}]", angle, states)
    expected = turned(changed - states.wrench)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-6 * np.abs(expected).max())


@pytest.mark.parametrize("frame", ["base axes", "flange axes"])
@pytest.mark.parametrize("held_by", ["base axes", "flange axes"])
def test_misaligned_force_in_a_pull_makes_the_moment_of_its_lever(case, frame, held_by):
    """A pull at a place of the flange, or at one that stays where it is while the flange turns: both levers are found."""
    chain, states, flange, turned = case
    lever = direction(held_by, flange, np.array([0.1, 0.4, -0.2]))
    states.wrench[:, 3:] = np.cross(lever, states.wrench[:, :3])
    angle = 1e-8 * np.array([3.0, -7.0, 2.0])
    force = Rotation.from_rotvec(direction(frame, flange, angle)).apply(states.wrench[:, :3])
    expected = turned(np.concatenate([force, np.cross(lever, force)], axis=1) - states.wrench)
    found = made_by(chain, f"force_misalignment[{frame} in the pull]", angle, states)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-6 * np.abs(expected).max())


def test_moments_that_no_pull_makes_stay_as_they_are(case):
    chain, states, _, _ = case
    at_flange, in_pull = (
        made_by(chain, f"force_misalignment[base axes{how}]", [1e-3, 2e-3, 3e-3], states) for how in ("", " in the pull")
    )
    np.testing.assert_array_equal(at_flange, in_pull)


@pytest.mark.parametrize("frame", ["base axes", "flange axes"])
def test_other_application_point_adds_the_moment_of_the_shifted_force(case, frame):
    chain, states, flange, turned = case
    shift = np.array([0.02, -0.01, 0.03])
    changed = states.wrench.copy()
    changed[:, 3:] += np.cross(direction(frame, flange, shift), states.wrench[:, :3])
    assert_made_by_the_change(made_by(chain, f"application_point[{frame}]", shift, states), turned, states.wrench, changed)


def test_application_point_is_the_wrench_stated_at_the_shifted_point(case):
    """A force at a point of the flange: the Jacobian of that point gives the same torques."""
    chain, states, _, turned = case
    shift = np.array([0.02, -0.01, 0.03])
    states.wrench[:, 3:] = 0.0
    there = PinocchioPoint(chain, replace(chain.end_effector, offset_m=tuple(shift)))
    torque = [there.pose_and_jacobian(q)[2].T @ w for q, w in zip(states.joint_angles, states.wrench, strict=True)]
    expected = np.array(torque) * COMPLIANCE[: chain.coordinates] - turned(states.wrench)
    found = made_by(chain, "application_point[flange axes]", shift, states)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-13)
