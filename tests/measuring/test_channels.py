"""Kinds and features of campaign.yaml become channels, or are refused in one line."""

import numpy as np
import pytest
from support import refused

from elastocal.measuring.channels import parse_measuring

POINTS = {
    "measured": "point",
    "frame": "unknown",
    "features": {"A": {}, "B": {}, "C": {}},
}


def distance(first, second, length, std=1e-4):
    return {"between": [first, second], "distance_m": length, "std_m": std}


def test_a_campaign_of_one_kind_of_poses_needs_no_channels():
    for name, rows in (("position", 3), ("pose", 6), ("board", 6), ("relative", 6)):
        plan = parse_measuring({"measured": name, "frame": "base"}, "c")
        assert plan.channels == ()
        assert plan.rows == rows


def test_kinds_of_equal_numbers_keep_whole_rows_and_others_are_split():
    features = {"A": {"kind": "point"}, "table": {"kind": "plane"}}
    document = {"measured": ["point", "plane"], "frame": "base", "features": features}
    plan = parse_measuring(document, "c")
    assert plan.rows == 1
    assert [channel.component for channel in plan.channels] == [0, 1, 2, None]
    document = {
        "measured": ["position", "point"],
        "frame": "base",
        "features": {"A": {}},
    }
    plan = parse_measuring(document, "c")
    assert plan.rows == 3
    assert [channel.feature for channel in plan.channels] == [None, 0]
    assert plan.error == "position error or distance from the touched place"


def test_three_distances_are_a_triangle_with_standard_deviations_by_propagation():
    stated = [distance("A", "B", 0.3), distance("A", "C", 0.4), distance("B", "C", 0.5)]
    plan = parse_measuring(POINTS | {"distances": stated}, "c")
    places = np.array([feature.stated["position_m"] for feature in plan.features])
    np.testing.assert_allclose(
        places, [[0, 0, 0], [0.3, 0, 0], [0, 0.4, 0]], atol=1e-15
    )
    deviations = np.array([feature.stated["std_m"] for feature in plan.features])
    draws = np.random.default_rng(1).normal([0.3, 0.4, 0.5], 1e-4, (20000, 3)).T
    x = (draws[1] ** 2 + draws[0] ** 2 - draws[2] ** 2) / (2 * draws[0])
    y = np.sqrt(draws[1] ** 2 - x**2)
    np.testing.assert_allclose(deviations[2, :2], [x.std(), y.std()], rtol=0.03)
    np.testing.assert_allclose(deviations[:2], [[0, 0, 0], [1e-4, 0, 0]])


@pytest.mark.parametrize(
    ("change", "phrases"),
    [
        ({"measured": "plan"}, ("measured", "'plan'", "plane")),
        ({"features": {}}, ("features", "none of kind point", "kind: point")),
        ({"features": {"A": {"kind": "plane"}}}, ("features.A.kind", "'plane'")),
        ({"features": {1: {}}}, ("the name 1", "in quotes")),
        ({"distances": [distance("A", "D", 1.0)]}, ("distances[0].between", "'D'")),
        (
            {"distances": [distance("A", "B", 1.0)], "frame": "base"},
            ("distances", "frame: unknown"),
        ),
        (
            {"distances": [distance("A", "B", 1.0), distance("B", "C", 1.0)]},
            ("2 distances of 3 places", "all three of three"),
        ),
        (
            {
                "distances": [
                    distance("A", "B", 0.1),
                    distance("A", "C", 0.1),
                    distance("B", "C", 0.3),
                ]
            },
            ("no triangle",),
        ),
        (
            {
                "features": {"A": {"position_m": [0, 0, 0]}, "B": {}},
                "distances": [distance("A", "B", 1.0)],
            },
            ("features.A.position_m", "one of them"),
        ),
    ],
)
def test_what_no_kind_can_use_is_refused_in_one_line(change, phrases):
    with refused("c", *phrases):
        parse_measuring(POINTS | change, "c")


@pytest.mark.parametrize(
    ("document", "value_m", "shows_lengths"),
    [
        ({"measured": "plane", "features": {"table": {}}}, 0.0, False),
        ({"measured": "plane", "features": {"table": {}}}, 0.02, True),
        ({"measured": "point", "features": {"A": {}}}, 0.0, False),
        (
            {"measured": "point", "features": {"A": {"position_m": [1, 0, 0]}}},
            0.0,
            True,
        ),
        ({"measured": "sphere", "features": {"ball": {"radius_m": 0.6}}}, 0.0, True),
        ({"measured": "sphere", "features": {"ball": {"radius_m": 0.1}}}, 0.0, False),
        ({"measured": "line", "features": {"gauge": {}}}, 0.0, True),
        ({"measured": "position"}, 0.0, True),
    ],
)
def test_contacts_with_unknown_features_contain_no_length(
    document, value_m, shows_lengths
):
    plan = parse_measuring({"frame": "base"} | document, "c")
    assert plan.shows_lengths(np.full((4, 1), value_m)) == shows_lengths


@pytest.mark.parametrize(
    ("measured", "value_m", "is_touch_alone"),
    [
        (["plane"], 0.0, True),
        (["plane"], 0.02, False),
        (["point"], 0.0, False),
        (["line"], 0.0, False),
        (["plane", "sphere"], 0.0, True),
        (["plane", "point"], 0.0, False),
    ],
)
def test_contacts_with_a_single_number_are_touches(measured, value_m, is_touch_alone):
    features = {kind: {"kind": kind} for kind in measured}
    document = {"measured": measured, "features": features, "frame": "base"}
    plan = parse_measuring(document, "c")
    assert plan.is_touch_alone(np.full((4, 1), value_m)) == is_touch_alone
