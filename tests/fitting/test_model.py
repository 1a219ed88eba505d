"""The composite model: predictions by hand-made chains, sensitivities by central differences of its own exact residuals."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import root
from scipy.spatial.transform import Rotation
from support import OTHER_CHAINS, chain_of, random_angles
from synthetic import made_estimate, made_model, made_readings, made_states, seen_exactly, slopes, small_steps, with_noise

from elastocal.campaigns.campaign import Campaign, Target
from elastocal.effects.catalogue import candidates_on
from elastocal.fitting.model import (
    circumstances,
    declared_model,
    displaced_coordinates,
    joint_compliances,
    linearize,
    measured_in_base,
    parameters,
    predict,
    residuals,
    stepped,
)
from elastocal.mechanics.elastostatics import exact_deflections, joint_torques
from elastocal.mechanics.kinematics import poses
from elastocal.mechanics.robot import Mass

TARGETS = Target("A", "6DoF", None), Target("B", "3DoF", (0.1, 0.0, -0.2)), Target("C", "6DoF", None)


@pytest.fixture(params=[3, 6], ids=["positions", "poses"])
def case(request, fanuc):
    """Two sessions, three targets, two effects and springs that are identified; every parameter somewhere."""
    known = candidates_on(made_model(fanuc.chain).sites)
    effects = known["lost_motion@2"], known["link_geometry@3"]
    model = made_model(fanuc.chain, TARGETS, request.param, effects=effects, identified=True)
    estimate, states = made_estimate(model, (0, 4), seed=1), made_states(6, 8, seed=2, sessions=2)
    states.session[:] = 4 * states.session
    return model, estimate, seen_exactly(model, estimate, states)


def test_sensitivities_are_central_differences_of_the_residuals(case):
    model, estimate, seen = case
    around = circumstances(model, estimate, seen.states)
    steps = np.diag(small_steps(model, estimate))
    expected = slopes(model, estimate, seen, around, steps)
    found = linearize(model, estimate, seen, around).sensitivities @ steps
    assert found.shape == expected.shape == (24, model.rows, len(parameters(model, estimate)))
    largest = np.abs(expected).max(axis=(0, 1))
    assert (largest > 0).all()
    np.testing.assert_allclose(found / largest, expected / largest, rtol=0, atol=1e-5)


def test_residual_is_what_was_added_to_the_readings_seen_in_base_axes(case):
    model, estimate, seen = case
    around = circumstances(model, estimate, seen.states)
    np.testing.assert_allclose(residuals(model, estimate, seen, around), 0.0, atol=1e-14)
    rng = np.random.default_rng(3)
    shift, turn = 1e-3 * rng.standard_normal((2, len(seen), 3))
    moved = replace(seen, position=seen.position + shift)
    if model.rows == 6:
        moved = replace(moved, rotation=Rotation.from_rotvec(turn).as_matrix() @ seen.rotation)
    into_base = estimate.frame_rotation[seen.states.session[seen.state] // 4].transpose(0, 2, 1)
    expected = [(into_base @ part[..., None])[..., 0] for part in (shift, turn)[: model.rows // 3]]
    found = residuals(model, estimate, moved, around)
    np.testing.assert_allclose(found, np.concatenate(expected, axis=1), rtol=0, atol=1e-13)
    np.testing.assert_array_equal(linearize(model, estimate, moved, around).residual, found)


def test_parameters_are_named_in_the_order_of_the_sensitivities(case):
    model, estimate, _ = case
    owners = [owner for owner, _ in parameters(model, estimate)]
    of_target = model.rows
    expected = ["frame 0"] * 6 + ["frame 4"] * 6 + ["target A"] * of_target + ["target C"] * of_target
    assert owners == [*expected, *["joint_compliance"] * 6, *["lost_motion@2"] * 2, *["link_geometry@3"] * 6]
    names = [parameter.name for _, parameter in parameters(model, estimate)]
    assert names[:6] == ["dx", "dy", "dz", "rx", "ry", "rz"]
    assert names[-8:-6] == ["half_play", "torque"]


def test_frame_of_one_session_moves_only_its_own_readings(case):
    model, estimate, seen = case
    columns = linearize(model, estimate, seen, circumstances(model, estimate, seen.states)).sensitivities
    later = seen.states.session[seen.state] == 4
    assert not columns[later][..., :6].any() and not columns[~later][..., 6:12].any()
    assert columns[later][..., 6:12].any() and columns[~later][..., :6].any()


def test_step_of_every_parameter_can_be_taken_back_to_second_order(case):
    model, estimate, _ = case
    step = 1e-6 * np.array([parameter.plausible for _, parameter in parameters(model, estimate)])
    there = stepped(model, estimate, step)
    back = stepped(model, there, -step)
    for name in ("frame_rotation", "frame_position", "target_offset", "target_rotation"):
        np.testing.assert_allclose(getattr(back, name), getattr(estimate, name), rtol=0, atol=1e-11)
    for ours, theirs in zip((*back.coefficients, *back.shapes), (*estimate.coefficients, *estimate.shapes), strict=True):
        np.testing.assert_allclose(ours, theirs, rtol=1e-12, atol=1e-20)
    assert np.abs(there.frame_position - estimate.frame_position).max() > 1e-7
    # Target B is known, whatever the step.
    np.testing.assert_array_equal(there.target_offset[1], (0.1, 0.0, -0.2))


def test_steps_keep_rotations_orthonormal_and_shapes_in_their_range(case):
    model, estimate, _ = case
    there = stepped(model, estimate, np.full(len(parameters(model, estimate)), 1e4))
    for turn in (*there.frame_rotation, *there.target_rotation):
        np.testing.assert_allclose(turn @ turn.T, np.eye(3), atol=1e-10)
    assert there.shapes[1][0] == model.effects[1].shapes[0].highest


def test_nominal_springs_deflect_as_equation_9_with_exact_kinematics(fanuc):
    targets = tuple(Target(p.name, p.name, (0.05, 0.1, -0.1)) for p in fanuc.chain.points)
    model = made_model(fanuc.chain, targets, 6, fitted_frames=False, compliance=fanuc.compliance)
    estimate, states = made_estimate(model), made_states(6, 6, seed=4)
    seen = seen_exactly(model, estimate, states)
    position, rotation = predict(model, estimate, seen, circumstances(model, estimate, states))
    turned = equilibrium(fanuc.chain, fanuc.compliance, states)
    for index, point in enumerate(fanuc.chain.points):
        target = replace(point, offset_m=(0.05, 0.1, -0.1))
        expected = poses(fanuc.chain, states.joint_angles + turned, target)
        np.testing.assert_allclose(position[seen.target == index], expected[0], rtol=0, atol=1e-9)
        np.testing.assert_allclose(rotation[seen.target == index], expected[1], rtol=0, atol=1e-9)
    bent = exact_deflections(fanuc.chain, states.joint_angles, turned, fanuc.chain.end_effector)
    assert np.abs(bent).max() > 1e-4


def equilibrium(chain, compliance, states, weighing=None):
    """Turn of each joint where the springs hold the load at the pose to which it has turned them, by scipy's root finder."""
    end = replace(chain.end_effector, offset_m=(0, 0, 0))

    def unbalanced(turned, q, wrench):
        torque = joint_torques(chain, q + turned, wrench, end)
        return turned - compliance * (torque if weighing is None else torque + weighing(q + turned))

    pairs = zip(states.joint_angles, states.wrench, strict=True)
    return np.array([root(unbalanced, np.zeros(len(q)), (q, wrench), tol=1e-15).x for q, wrench in pairs])


def test_load_is_taken_at_the_deflected_pose_as_a_solver_of_the_equilibrium_finds_it(fanuc):
    model = made_model(fanuc.chain, fitted_frames=False, compliance=fanuc.compliance)
    estimate, states = made_estimate(model), made_states(6, 40, seed=12)
    states.wrench[:] *= (3000.0 / np.linalg.norm(states.wrench[:, :3], axis=1))[:, None]
    found = displaced_coordinates(model, estimate, circumstances(model, estimate, states))[:, :6]
    turned = equilibrium(fanuc.chain, fanuc.compliance, states)
    end = fanuc.chain.end_effector
    ends = [poses(fanuc.chain, q, end)[0] for q in (found, states.joint_angles + turned)]
    assert np.linalg.norm(ends[0] - ends[1], axis=1).max() < 1e-8
    # At the commanded pose the load would be off by far more than a tracker's noise.
    torques = joint_torques(fanuc.chain, states.joint_angles, states.wrench, end)
    there = poses(fanuc.chain, states.joint_angles + fanuc.compliance * torques, end)[0]
    assert np.linalg.norm(there - ends[1], axis=1).max() > 5e-5


def test_wrench_acts_at_the_last_measuring_point_and_not_at_a_target_on_it(fanuc):
    chain = replace(fanuc.chain, points=tuple(replace(p, offset_m=(0.3, 0.2, 0.1)) for p in fanuc.chain.points))
    states = made_states(6, 5, seed=5)
    loads = [circumstances(model, made_estimate(model), states).load for model in (made_model(chain), made_model(fanuc.chain))]
    np.testing.assert_allclose(*loads, rtol=0, atol=1e-11)


def test_identified_compliances_replace_the_nominal_ones(fanuc):
    fixed = made_model(fanuc.chain, compliance=fanuc.compliance)
    free = made_model(fanuc.chain, compliance=9 * fanuc.compliance, identified=True)
    estimate, states = made_estimate(fixed, seed=6), made_states(6, 5, seed=7)
    same = replace(estimate.with_effects(free.effects), coefficients=(fanuc.compliance,))
    np.testing.assert_array_equal(joint_compliances(free, same), fanuc.compliance)
    np.testing.assert_array_equal(joint_compliances(fixed, estimate), fanuc.compliance)
    seen = seen_exactly(fixed, estimate, states)
    np.testing.assert_allclose(residuals(free, same, seen, circumstances(free, same, states)), 0.0, atol=1e-14)


@pytest.mark.parametrize("name", OTHER_CHAINS)
def test_effects_at_zero_leave_the_declared_model(name):
    chain = chain_of(OTHER_CHAINS[name])
    model = made_model(chain, rows=6)
    estimate, states = made_estimate(model, seed=8), made_states(chain.coordinates, 4, seed=9)
    effects = tuple(candidates_on(model.sites).values())
    more, same = model.with_effects(effects), estimate.with_effects(effects)
    seen = seen_exactly(model, estimate, states)
    np.testing.assert_allclose(residuals(more, same, seen, circumstances(more, same, states)), 0.0, atol=1e-14)


def test_effects_add_up_on_the_coordinates_of_the_sites(fanuc):
    known = candidates_on(made_model(fanuc.chain).sites)
    offset, growth, frame = (known[key] for key in ("joint_offset@2", "stiffening@2", "base_compliance"))
    model = made_model(fanuc.chain, compliance=fanuc.compliance, effects=(offset, growth, frame))
    estimate, states = made_estimate(model, seed=10), made_states(6, 5, seed=11)
    around = circumstances(model, estimate, states)
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


def test_readings_are_taken_into_base_axes_by_the_frame_of_their_session(case):
    model, estimate, seen = case
    position, rotation = measured_in_base(estimate, seen)
    known = predict(model, estimate, seen, circumstances(model, estimate, seen.states))
    np.testing.assert_allclose(position, known[0], rtol=0, atol=1e-14)
    if model.rows == 6:
        np.testing.assert_allclose(rotation, known[1], rtol=0, atol=1e-14)
    else:
        assert rotation is None


def test_known_frame_known_targets_and_no_effects_leave_no_parameters(fanuc):
    model = made_model(fanuc.chain, TARGETS[1:2], fitted_frames=False)
    estimate, states = made_estimate(model), made_states(6, 5)
    seen = with_noise(seen_exactly(model, estimate, states), np.random.default_rng(0))
    line = linearize(model, estimate, seen, circumstances(model, estimate, states))
    assert parameters(model, estimate) == [] and line.sensitivities.shape == (5, 3, 0)


@pytest.mark.parametrize(("measured", "rows"), [("position", 3), ("pose", 6)])
@pytest.mark.parametrize(("frame", "fitted"), [("tracker", True), ("base", False)])
@pytest.mark.parametrize("compliance", ["nominal", "identify"])
def test_declared_model_is_that_of_the_campaign(fanuc, measured, rows, frame, fitted, compliance):
    bare = made_model(fanuc.chain, (Target("A", "6DoF", (0, 0, 0)),))
    readings = made_readings(bare, np.random.default_rng(0), 2, 1, 0.0, 0.0)
    readings = replace(readings, time_s=np.array([7.0, 5.0]), row=np.array([4, 9]))
    campaign = Campaign("c", fanuc, measured, frame, TARGETS, compliance, (), None, {}, readings)
    offset = candidates_on(made_model(fanuc.chain).sites)["joint_offset@2"]
    model = declared_model(campaign, (offset,))
    assert (model.rows, model.fitted_frames, model.targets) == (rows, fitted, TARGETS)
    assert model.identifies_compliance == (compliance == "identify")
    assert [effect.key for effect in model.effects][-1] == "joint_offset@2"
    np.testing.assert_array_equal(model.nominal_compliance, fanuc.compliance)
    assert model.time_zero_s == 5.0 and model.row_span == (4, 9)


def test_declared_model_weighs_what_the_robot_file_weighs(fanuc):
    bare = made_model(fanuc.chain, (Target("A", "6DoF", (0, 0, 0)),))
    readings = made_readings(bare, np.random.default_rng(0), 2, 1, 0.0, 0.0)
    robot = replace(fanuc, masses=(Mass(2, 100.0, (0.5, 0.0, 0.0), 0.1),), gravity_m_s2=(0.0, 0.0, 9.0), gear_ratio=(None,) * 6)
    model = declared_model(Campaign("c", robot, "position", "base", TARGETS, "identify", (), None, {}, readings))
    assert [effect.key for effect in model.effects] == ["joint_compliance", "declared_weight"]
    assert model.sites.masses == robot.masses and model.sites.gravity_m_s2 == (0.0, 0.0, 9.0)


def test_coordinate_jacobian_is_that_of_each_target(case):
    model, estimate, seen = case
    around = circumstances(model, estimate, seen.states)
    line = linearize(model, estimate, seen, around)
    assert line.coordinate_jacobian.shape == (24, model.rows, model.sites.chain.coordinates)
    # Target B sits behind joint 3: what lies further out does not move it.
    assert not line.coordinate_jacobian[seen.target == 1][..., 3:6].any()
    assert line.coordinate_jacobian[seen.target != 1][..., 3:6].any()
    bare = random_angles(np.random.default_rng(0), model.sites.chain)
    assert len(bare) == line.coordinate_jacobian.shape[2]
