"""The vector of parameters: its order, and steps of it that can be taken back."""

import numpy as np

from elastocal.fitting.parameters import parameters, stepped


def test_parameters_are_named_in_the_order_of_the_sensitivities(full_case):
    model, estimate, _ = full_case
    owners = [owner for owner, _ in parameters(model, estimate)]
    of_target = model.rows
    expected = ["frame 0"] * 6 + ["frame 4"] * 6 + ["target A"] * of_target + ["target C"] * of_target
    assert owners == [*expected, *["joint_compliance"] * 6, *["lost_motion@2"] * 2, *["link_geometry@3"] * 6]
    names = [parameter.name for _, parameter in parameters(model, estimate)]
    assert names[:6] == ["dx", "dy", "dz", "rx", "ry", "rz"]
    assert names[-8:-6] == ["half_play", "torque"]


def test_step_of_every_parameter_can_be_taken_back_to_second_order(full_case):
    model, estimate, _ = full_case
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


def test_steps_keep_rotations_orthonormal_and_shapes_in_their_range(full_case):
    model, estimate, _ = full_case
    there = stepped(model, estimate, np.full(len(parameters(model, estimate)), 1e4))
    for turn in (*there.frame_rotation, *there.target_rotation):
        np.testing.assert_allclose(turn @ turn.T, np.eye(3), atol=1e-10)
    assert there.shapes[1][0] == model.effects[1].shapes[0].highest
