"""Descriptions of campaigns of an unloaded flange in a frame that nobody knows."""

import pytest

from elastocal.campaigns.importers.unloaded import unloaded_document
from elastocal.effects.catalogue import effects
from elastocal.io.documents import check_document


def test_targets_are_unknown_offsets_from_the_last_point_in_a_trackers_frame():
    assert unloaded_document("c", "kuka", "pose", ("A", "B")) == {
        "campaign": "c",
        "robot": "kuka",
        "measured": "pose",
        "frame": "tracker",
        "targets": {name: {"point": "6DoF", "offset_m": "unknown"} for name in "AB"},
        "compliance": "nominal",
        "declared": ["joint_offset", "link_geometry"],
    }


def test_noise_and_hold_out_are_there_where_they_are_given_and_nowhere_else():
    noise, holdout = {"position_m": 5e-5}, {"fraction": 0.3, "seed": 1}
    with_both = unloaded_document("c", "kuka", "position", "A", holdout, noise)
    assert (with_both["noise"], with_both["holdout"]) == (noise, holdout)
    assert set(with_both) - set(unloaded_document("c", "kuka", "position", "A")) == {"noise", "holdout"}
    assert "holdout" not in unloaded_document("c", "kuka", "position", "A", None, noise)


def test_what_was_handed_in_may_change_afterwards():
    noise = {"position_m": 5e-5}
    document = unloaded_document("c", "kuka", "position", "A", None, noise)
    noise["position_m"] = 1.0
    document["declared"].append("hysteresis")
    assert document["noise"] == {"position_m": 5e-5}
    assert unloaded_document("c", "kuka", "position", "A")["declared"] == ["joint_offset", "link_geometry"]


def test_a_chain_of_seven_joints_names_its_own_last_point():
    document = unloaded_document("c", "wam", "position", ("A",), point="7DoF")
    assert document["targets"] == {"A": {"point": "7DoF", "offset_m": "unknown"}}


@pytest.mark.parametrize("measured", ["position", "pose"])
def test_the_description_is_one_that_the_schema_takes_and_declares_effects_of_the_catalogue(measured):
    document = unloaded_document("c", "kuka", measured, ("A",), {"session": 1}, {"position_m": 5e-5})
    check_document(document, "campaign", "c")
    assert set(document["declared"]) <= set(effects())
