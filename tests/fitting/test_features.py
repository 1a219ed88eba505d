"""Campaigns of several kinds are fitted as one, with the noise of each kind."""

import numpy as np
import pytest
from contact_campaigns import (
    TOOL_M,
    build_contact_case,
    count_std_errors,
    fit_contacts,
    open_workshop,
    spread_places,
    touch_crossing_planes,
    write_contacts,
)
from scipy.spatial.transform import Rotation

from elastocal.fitting.features import (
    find_middle,
    list_feature_parameters,
    list_fitted_features,
)
from elastocal.fitting.least_squares import fit_model, register_placement
from elastocal.fitting.linearization import linearize_residual
from elastocal.fitting.model import apply_step, list_parameters
from elastocal.fitting.noise import Noise
from elastocal.fitting.normal_equations import LeastSquaresProblem
from elastocal.fitting.observations import select_states
from elastocal.measuring.channels import parse_measuring
from elastocal_proof.plant.contacts import seat_in_socket, touch_plane

# Two sockets whose distance is printed, along y of their session.
PRINTED_SOCKETS = {
    "socket0": {"position_m": [0, 0, 0], "std_m": 0},
    "socket1": {"position_m": [0, 0.05, 0], "std_m": [0, 1e-4, 0]},
}


def test_exact_unknowns_are_not_fitted_and_others_have_their_priors():
    features = {
        "A": {"position_m": [0, 0, 0], "std_m": 0},
        "B": {"position_m": [1, 0, 0], "std_m": [1e-3, 0, 0]},
        "C": {},
    }
    document = {"measured": "point", "frame": "unknown", "features": features}
    plan = parse_measuring(document, "c")
    fitted = list_fitted_features(plan)
    assert [entry.numbers for entry in fitted] == [[0], [0, 1, 2]]
    assert [entry.columns for entry in fitted] == [slice(0, 1), slice(1, 4)]
    parameters = list_feature_parameters(fitted)
    assert [owner for owner, _ in parameters] == ["feature B"] + ["feature C"] * 3
    assert [p.prior_std for _, p in parameters] == [1e-3, None, None, None]


def test_sockets_and_a_plane_together_identify_the_joint_offsets(tmp_path):
    workshop = open_workshop(7)
    places = spread_places(workshop, 2)
    up = np.array([0.0, 0.0, 1.0])
    rows = []
    for row in range(40):
        seat = seat_in_socket(workshop, places[row % 2], 1e-4)
        rows.append({"angles": seat, "feature": f"socket{row % 2}"})
        touch = touch_plane(workshop, up, up @ places[0], 3e-5)
        rows.append({"angles": touch, "feature": "table"})
    features = {f"socket{number}": {"kind": "point"} for number in range(2)}
    document = {
        "measured": ["point", "plane"],
        "features": features | {"table": {"kind": "plane"}},
        "noise": {"by_kind": {"point": 1e-4, "plane": 3e-5}},
    }
    fitted = fit_contacts(write_contacts(tmp_path / "cell", document, rows))
    assert fitted.converged
    assert np.abs(count_std_errors(fitted)).max() < 4.0
    np.testing.assert_allclose(fitted.estimate.target_offset[0], TOOL_M, atol=3e-4)
    # Each kind leaves its own noise.
    channel = np.isclose(fitted.whiten(fitted.residual), fitted.residual / 3e-5)
    assert channel.any()
    white = fitted.whiten(fitted.residual)
    assert 0.8 < np.sqrt((white**2).mean()) < 1.1


def test_sockets_have_a_middle_and_planes_have_none():
    document = {"measured": "point", "frame": "unknown", "features": {"A": {}, "B": {}}}
    plan = parse_measuring(document, "c")
    places = (np.array([1.0, 0.0, 0.0]), np.array([3.0, 2.0, 0.0]))
    np.testing.assert_array_equal(find_middle(plan, places), [2.0, 1.0, 0.0])
    features = {"A": {"kind": "point"}, "table": {"kind": "plane"}}
    document = {"measured": ["point", "plane"], "features": features}
    values = (places[0], np.array([0.0, 0.0, 1.0, 0.5]))
    assert find_middle(parse_measuring(document, "c"), values) is None
    assert find_middle(None, ()) is None


def hold_in_two_sockets(folder, features):
    """A case of a ball in two sockets, 50 mm apart, at two places."""
    workshop = open_workshop(3)
    socket_m = np.array([0.0, 0.05, 0.0])
    rows = []
    for session, place in enumerate(spread_places(workshop, 2)):
        for row in range(20):
            seat = seat_in_socket(workshop, place + row % 2 * socket_m, 1e-4)
            feature = f"socket{row % 2}"
            rows.append({"angles": seat, "feature": feature, "session": session})
    document = {"measured": "point", "frame": "unknown", "features": features}
    return build_contact_case(write_contacts(folder, document, rows))


def test_a_base_turns_about_the_middle_of_the_sockets(tmp_path):
    """Two near sockets hardly determine how the base is turned about the line through
    them. Turned about its origin, a base a metre away moves the sockets by the square of
    the turn, and fits crept along a bent path without an end."""
    case = hold_in_two_sockets(tmp_path / "cell", {"socket0": {}, "socket1": {}})
    start = register_placement(case.model, case.observations)
    middle = np.mean(start.features, axis=0)
    turn = np.array([0.1, -0.05, 0.02])
    step = np.zeros(len(list_parameters(case.model, start)))
    step[9:12] = turn
    moved = apply_step(case.model, start, step)
    in_base = start.frame_rotation[1].T @ (middle - start.frame_position[1])
    # The linear motion of a point at the middle, without terms of second order.
    expected = middle + start.frame_rotation[1] @ np.cross(turn, in_base)
    reached = moved.frame_rotation[1] @ in_base + moved.frame_position[1]
    np.testing.assert_allclose(reached, expected, atol=1e-12)
    turned = start.frame_rotation[1] @ Rotation.from_rotvec(turn).as_matrix()
    np.testing.assert_allclose(moved.frame_rotation[1], turned, atol=1e-12)
    np.testing.assert_array_equal(moved.frame_position[0], start.frame_position[0])


def test_a_turn_about_the_line_through_two_sockets_is_left_alone(tmp_path):
    """No measurement shows it. If axes of the residual were fixed while the base turns,
    joint errors that poses have in common would seem to show it, and the fit would turn
    the base in each step."""
    case = hold_in_two_sockets(tmp_path / "cell", PRINTED_SOCKETS)
    noise = Noise("declared", 1e-4, 1e-4, np.zeros(6), pose_rad=3e-4)
    fitted = fit_model(case.model, case.observations, noise)
    assert fitted.converged
    linear_model = linearize_residual(
        fitted.model, fitted.estimate, case.observations, fitted.conditions
    )
    sensitivities = linear_model.sensitivities
    for session, rotation in enumerate(fitted.estimate.frame_rotation):
        # The line of both sockets, in the axes of the base.
        line = rotation.T @ [0.0, 1.0, 0.0]
        middle = rotation.T @ (
            [0.0, 0.025, 0.0] - fitted.estimate.frame_position[session]
        )
        turn = np.concatenate([np.cross(middle, line), line])
        columns = slice(6 * session, 6 * session + 6)
        np.testing.assert_allclose(sensitivities[..., columns] @ turn, 0.0, atol=1e-9)


def test_the_gradient_of_frames_is_that_of_the_squares_where_a_stand_has_crept(
    tmp_path,
):
    """The coordinates of the base turn it about its displaced origin, and the frame
    turns the displacement as well."""
    case = hold_in_two_sockets(tmp_path / "cell", PRINTED_SOCKETS)
    model = case.model.with_effects([case.candidates["stand_creep[session 1]"]])
    start = register_placement(model, case.observations)
    draws = np.random.default_rng(1)
    start.coefficients[-1][:] = 5e-3 * draws.standard_normal(
        len(start.coefficients[-1])
    )
    noise = Noise("declared", 1e-4, 1e-4, np.zeros(6))
    count = len(list_parameters(model, start))
    problem = LeastSquaresProblem(
        model, case.observations, noise, start, np.ones(count)
    )
    problem.linearize(start)
    problem.whiten()
    weights = np.ones(len(case.observations))
    _, gradient = problem.normal_equations(weights)
    size = 1e-7
    for step, slope in zip(size * np.eye(count)[:12], gradient, strict=False):
        above, below = (
            problem.squares(weights, apply_step(model, start, sign * step))
            for sign in (1.0, -1.0)
        )
        assert (below - above) / (4.0 * size) == pytest.approx(
            slope, abs=1e-5 * np.abs(gradient[:12]).max()
        )


def test_a_feature_that_no_row_of_a_sample_touches_has_finite_values(tmp_path):
    workshop = open_workshop(7)
    rows, features = touch_crossing_planes(workshop, 5, 3e-5)
    document = {"measured": "plane", "features": features}
    case = build_contact_case(write_contacts(tmp_path / "cell", document, rows))
    touched = np.unique(case.observations.channel)
    assert len(touched) == 3
    is_first = case.observations.channel == touched[0]
    sampled = np.zeros(len(case.observations.states), bool)
    sampled[case.observations.state[is_first]] = True
    sample = select_states(case.observations, sampled)
    start = register_placement(case.model, sample)
    assert all(np.isfinite(values).all() for values in start.features)
