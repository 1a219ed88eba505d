"""The vector of parameters: its order, and steps of it that can be taken back."""

import numpy as np
import pytest
from fitted_models import model_of
from synthetic import made_estimate, made_model

from elastocal.campaigns.campaign import Target
from elastocal.fitting.model import limits, nonlinear_parameters, parameter_values, parameters, stepped


def test_parameters_are_named_in_the_order_of_the_sensitivities(full_case):
    model, estimate, _ = full_case
    owners = [owner for owner, _ in parameters(model, estimate)]
    of_target = model.rows
    expected = ["frame 0"] * 6 + ["frame 4"] * 6 + ["target A"] * of_target + ["target C"] * of_target
    assert owners == [*expected, *["joint_compliance"] * 6, *["lost_motion@2"] * 2, *["link_geometry@3"] * 6]
    names = [parameter.name for _, parameter in parameters(model, estimate)]
    assert names[:6] == ["dx", "dy", "dz", "rx", "ry", "rz"]
    assert names[-8:-6] == ["half_play", "torque"]


def test_of_a_target_only_what_is_unknown_is_a_parameter(fanuc):
    targets = [
        Target("turn", "6DoF", (0.0, 0.0, 0.1), None),
        Target("place", "6DoF", None, (0.0, 0.0, 1.5)),
        Target("known", "6DoF", (0.0, 0.0, 0.1), (1.0, 0.0, 0.0)),
        Target("both", "6DoF", None),
    ]
    names = {6: ["turn rx", "turn ry", "turn rz", "place dx", "place dy", "place dz"], 3: ["place dx", "place dy", "place dz"]}
    both = {6: ["dx", "dy", "dz", "rx", "ry", "rz"], 3: ["dx", "dy", "dz"]}
    for rows in (6, 3):
        model = made_model(fanuc.chain, targets, rows=rows, fitted_frames=False)
        estimate = made_estimate(model, seed=3)
        expected = [*names[rows], *(f"both {name}" for name in both[rows])]
        owned = parameters(model, estimate)
        assert [f"{owner.removeprefix('target ')} {parameter.name}" for owner, parameter in owned] == expected
        there = stepped(model, estimate, np.full(len(expected), 1e-3))
        moved = np.abs(there.target_offset - estimate.target_offset).max(axis=1) > 0
        turned = np.abs(there.target_rotation - estimate.target_rotation).max(axis=(1, 2)) > 1e-4
        assert moved.tolist() == [False, True, False, True] and turned.tolist() == [rows == 6, False, False, rows == 6]


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


@pytest.fixture
def two_laws(fanuc):
    """A model of two laws with a shape of one name, and one without, somewhere."""
    model = model_of(fanuc, "lost_motion@2", "link_geometry@3", "stiffening@4")
    return model, made_estimate(model, seed=7)


def owned(model, estimate, key, name):
    """Places of one parameter of one owner."""
    return [n for n, (owner, p) in enumerate(parameters(model, estimate)) if (owner, p.name) == (key, name)]


def test_only_shapes_have_limits_each_those_of_its_own_law(two_laws):
    model, estimate = two_laws
    found, expected = limits(model, estimate), np.tile([-np.inf, np.inf], (len(parameters(model, estimate)), 1))
    for effect in (model.effects[0], model.effects[2]):
        (place,) = owned(model, estimate, effect.key, "torque")
        expected[place] = effect.shapes[0].lowest, effect.shapes[0].highest
    np.testing.assert_array_equal(found, expected)
    np.testing.assert_array_equal(nonlinear_parameters(model, estimate), np.isfinite(expected[:, 0]))
    assert np.isfinite(expected).sum() == 4


@pytest.mark.parametrize(("step", "end"), [(-1e9, "lowest"), (1e9, "highest")])
@pytest.mark.parametrize("place", [0, 2])
def test_a_step_of_a_shape_ends_at_the_end_of_its_own_range(two_laws, place, step, end):
    model, estimate = two_laws
    whole = np.zeros(len(parameters(model, estimate)))
    whole[owned(model, estimate, model.effects[place].key, "torque")] = step
    there = stepped(model, estimate, whole)
    assert there.shapes[place].tolist() == [getattr(model.effects[place].shapes[0], end)]
    for number in {0, 1, 2} - {place}:
        np.testing.assert_array_equal(there.shapes[number], estimate.shapes[number])


def test_values_are_zero_for_frames_and_targets_and_those_of_coefficients_before_shapes(two_laws):
    model, estimate = two_laws
    whole = 1e-6 * np.arange(1.0, len(parameters(model, estimate)) + 1)
    there = stepped(model, estimate, whole)
    found = parameter_values(model, there)
    np.testing.assert_array_equal(found[:9], np.zeros(9))
    (play, taken_up), geometry, (beyond, meeting) = (
        np.concatenate([a, b]) for a, b in zip(estimate.coefficients, estimate.shapes, strict=True)
    )
    before = np.array([play, taken_up, *geometry, beyond, meeting])
    np.testing.assert_allclose(found[9:], before + whole[9:], rtol=1e-12, atol=0)
