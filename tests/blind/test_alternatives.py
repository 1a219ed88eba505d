"""An alternative explains the measurements as well as the true mechanism does."""

import pytest
from planted import planted

from elastocal_proof.blind.alternatives import find_alternatives
from elastocal_proof.blind.known_effects import score_candidates


def find_alternatives_of(robot, sizes, names, **settings):
    """Find the alternatives to planted effects among the mechanisms of these names."""
    campaign = planted(robot, sizes, 1, **settings)
    declared, observations = campaign.declared, campaign.observations
    planted_candidates = [campaign.candidates[key] for key in sizes]
    scored = score_candidates(declared, observations, planted_candidates)
    candidates = [
        candidate for candidate in campaign.all_candidates if candidate.effect in names
    ]
    return find_alternatives(declared, observations, candidates, [*scored.values()])


def test_the_geometry_of_a_link_is_an_alternative_to_an_offset_of_its_joint(kuka):
    names = ("joint_offset", "link_geometry")
    assert find_alternatives_of(kuka, {"joint_offset@3": 3e-4}, names) == [
        "link_geometry"
    ]


def test_a_mechanism_that_acts_otherwise_is_no_alternative(kuka):
    names = ("tracker_scale", "payload", "cross_compliance", "joint_offset")
    assert find_alternatives_of(kuka, {"joint_offset@3": 3e-4}, names) == []


def test_a_mechanism_with_more_parameters_is_excluded_by_the_simpler_one(kuka):
    # An offset of the joint makes one of the displacements that the link can make.
    names = ("joint_offset",)
    assert find_alternatives_of(kuka, {"link_geometry@3": 3e-4}, names) == []


@pytest.mark.parametrize("joints", [(2, 3), (2, 3, 4)])
def test_an_alternative_acts_at_as_many_joints_as_the_true_mechanism(kuka, joints):
    sizes = {f"joint_offset@{joint}": 3e-4 for joint in joints}
    assert find_alternatives_of(kuka, sizes, ("link_geometry",)) == ["link_geometry"]
