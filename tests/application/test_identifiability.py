"""The errors that a set-up cannot see are named, with the rows that would show them."""

import numpy as np
import pytest
from contact_campaigns import (
    build_contact_case,
    open_workshop,
    spread_places,
    write_contacts,
)

from elastocal.application.identifiability import (
    describe_unseen_errors,
    find_unseen_errors,
    predict_tip_error,
)
from elastocal.fitting.least_squares import fit_model
from elastocal.fitting.noise import estimate_noise
from elastocal_proof.plant.contacts import seat_in_socket

KNOWN = "places that are known in the base frame"
SCALE = "a common scale of all lengths"


@pytest.fixture(scope="module")
def rows():
    """Rows of a ball in two sockets, and where these are."""
    workshop = open_workshop(3)
    places = spread_places(workshop, 2)
    touched = [
        {
            "angles": seat_in_socket(workshop, places[row % 2], 5e-5),
            "feature": f"socket{row % 2}",
        }
        for row in range(50)
    ]
    return touched, places


def fit(folder, rows, features, frame="base", **keys):
    document = {
        "measured": "point",
        "frame": frame,
        "features": features,
        "noise": {"position_m": 5e-5},
        **keys,
    }
    case = build_contact_case(write_contacts(folder, document, rows))
    noise, _ = estimate_noise(case)
    return fit_model(case.model, case.observations, noise), case.observations


def test_unknown_sockets_hide_the_base_and_all_lengths(tmp_path, rows):
    fitted, observations = fit(tmp_path / "a", rows[0], {"socket0": {}, "socket1": {}})
    unseen = {
        error.name: error.remedy for error in find_unseen_errors(fitted, observations)
    }
    assert unseen["where the base stands along x"] == KNOWN
    assert unseen["the zero of joint 1"] == KNOWN
    assert unseen[SCALE] == "two sockets whose distance is known to 0.03 %"
    assert "the zero of joint 3" not in unseen
    sentences = describe_unseen_errors(find_unseen_errors(fitted, observations))
    assert any(
        "where the base stands and how it is turned" in text for text in sentences
    )
    assert all(
        text.startswith("these measurements do not determine") for text in sentences
    )


def test_sockets_that_are_known_in_the_base_show_where_it_stands(tmp_path, rows):
    touched, places = rows
    features = {
        f"socket{number}": {"position_m": place.tolist(), "std_m": 1e-5}
        for number, place in enumerate(places)
    }
    fitted, observations = fit(tmp_path / "b", touched, features)
    unseen = {error.name for error in find_unseen_errors(fitted, observations)}
    assert SCALE not in unseen
    assert "where the base stands along z" not in unseen


def test_the_stated_accuracy_of_a_distance_suffices_for_the_scale(tmp_path, rows):
    touched, places = rows
    distance_m = float(np.linalg.norm(places[1] - places[0]))
    for share, is_unseen in ((0.9 * 1e-3 / 3, False), (2.0 * 1e-3 / 3, True)):
        known = {
            "between": ["socket0", "socket1"],
            "distance_m": distance_m,
            "std_m": share * distance_m,
        }
        fitted, observations = fit(
            tmp_path / f"{share}",
            touched,
            {"socket0": {}, "socket1": {}},
            "unknown",
            distances=[known],
        )
        unseen = {error.name for error in find_unseen_errors(fitted, observations)}
        assert (SCALE in unseen) == is_unseen


def test_the_predicted_error_of_the_tip_falls_with_the_noise(tmp_path, rows):
    fitted, observations = fit(tmp_path / "c", rows[0], {"socket0": {}, "socket1": {}})
    error_m = predict_tip_error(fitted, observations)
    assert 1e-6 < error_m < 1e-3
    # A fit in which nothing is identified leaves the plausible sizes.
    lost = np.ones(len(fitted.unidentifiable), bool)
    ignorant = type(fitted)(**vars(fitted) | {"unidentifiable": lost})
    assert predict_tip_error(ignorant, observations) > 10 * error_m
