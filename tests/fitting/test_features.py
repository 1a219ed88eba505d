"""Campaigns of several kinds are fitted as one, with the noise of each kind."""

import numpy as np
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

from elastocal.fitting.features import list_feature_parameters, list_fitted_features
from elastocal.fitting.least_squares import register_placement
from elastocal.fitting.observations import select_states
from elastocal.measuring.channels import parse_measuring
from elastocal_proof.plant.contacts import seat_in_socket, touch_plane


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
