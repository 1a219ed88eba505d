"""What else could have made the residual: exact aliases are named, near relatives weighed, all else told apart."""

import numpy as np
import pytest
from planted import ELBOW_AND_HAND, HAND, planted
from scipy.linalg import subspace_angles

from elastocal.attribution import CONFOUNDED_BIC, UNRELATED_DEG, Attribution, attribute, by_effect, confounding
from elastocal.fitting import fit
from elastocal.screening import directions
from elastocal.selection import without


def found_in(campaign, *keys):
    """The fit with some effects, and these."""
    members = [campaign.candidates[key] for key in keys]
    model, start = campaign.declared.model.with_effects(members), campaign.declared.estimate.with_effects(members)
    return fit(model, campaign.observations, campaign.declared.noise, start), members


def attributed(campaign, *keys):
    final, members = found_in(campaign, *keys)
    p_values = {key: 0.01 * (1 + number) for number, key in enumerate(keys)}
    return attribute(final, members, p_values, campaign.observations, campaign.all_candidates)


ALIASES = ("compensator_stiffness@2", "joint_dependent_stiffness@2")


@pytest.mark.parametrize("found", ALIASES)
def test_compensator_and_joint_dependent_stiffness_of_its_joint_are_one_law(found, fanuc):
    """A compensator acts as a stiffness that depends on the angle of joint 2: no poses tell them apart."""
    (other,) = set(ALIASES) - {found}
    campaign = planted(fanuc, {found: share(fanuc, found, 0.8)}, seed=1, targets=ELBOW_AND_HAND)
    (attribution,) = attributed(campaign, found)
    assert attribution.alternatives[0] == other
    number = attribution.rivals.index(other)
    # The residual that is there: only its noise could tell them.
    assert attribution.angle_deg[number] < 5.0
    assert abs(attribution.bic_difference[number]) < CONFOUNDED_BIC


def share(robot, key, part):
    candidate = planted(robot, {}, poses=6).candidates[key]
    return [part * parameter.plausible for parameter in candidate.parameters]


def test_what_makes_something_of_its_own_has_no_alternative(fanuc):
    campaign = planted(fanuc, {"joint_offset@3": [5e-4]}, seed=2)
    (attribution,) = attributed(campaign, "joint_offset@3")
    assert attribution.alternatives == ()
    assert attribution.effect == "joint_offset" and [m.key for m in attribution.members] == ["joint_offset@3"]
    assert attribution.found_parameters == 1
    assert "joint_offset@3" not in attribution.rivals
    assert len(set(attribution.rivals)) == len(attribution.rivals)


FORMS = {
    "payload[mass]": ("payload", "payload[mass]"),
    "payload": ("payload", "payload[mass]"),
    "compensator_torque@2[first order]": ("compensator_torque@2", "compensator_torque@2[first order]"),
    "transmission_harmonic@3[orders 1-2]": tuple(f"transmission_harmonic@3[orders {band}]" for band in ("1-2", "3-6", "7-12")),
    "link_weight@2": ("link_weight@2",),
}


@pytest.mark.parametrize("found", FORMS)
def test_another_form_of_the_same_effect_at_the_same_joints_is_no_alternative(found, fanuc):
    """Its other joints may be."""
    campaign = planted(fanuc, {found: share(fanuc, found, 0.5)}, seed=6)
    (attribution,) = attributed(campaign, found)
    assert not set(FORMS[found]) & {*attribution.rivals, *attribution.alternatives}
    effect, joints = campaign.candidates[found].effect, campaign.candidates[found].joints
    others = [c for c in campaign.all_candidates if c.effect != effect or c.joints != joints]
    bare = without(found_in(campaign, found)[0], {found}, campaign.observations)
    testable = {candidate.key for candidate, _ in directions(bare, campaign.observations, others).candidates}
    assert set(attribution.rivals) == testable and len(testable) > 50


def test_angles_and_criteria_are_those_of_least_squares(fanuc):
    """Against the residual of the fit without what was found, at the noise of the fit with it."""
    key = "link_weight@3"
    campaign = planted(fanuc, {key: share(fanuc, key, 0.05)}, seed=3, targets=HAND, poses=15)
    final, members = found_in(campaign, key)
    (attribution,) = attribute(final, members, {key: 0.01}, campaign.observations, campaign.all_candidates)
    bare = without(final, {key}, campaign.observations)
    seen = directions(bare, campaign.observations, campaign.all_candidates, 0.0, 0.0)
    by_key = {}
    for (candidate, _), columns in zip(seen.candidates, seen.columns, strict=True):
        by_key.setdefault(candidate.key, []).append(columns)
    residual, rows, poses = seen.residual, len(seen.residual), len(np.unique(seen.cluster))

    def left(columns):
        return np.linalg.lstsq(columns, residual, rcond=None)[1][0]

    mine = by_key[key][0]
    fitted = mine @ np.linalg.lstsq(mine, residual, rcond=None)[0]
    rest = left(mine)
    assert len(attribution.rivals) > 50
    for number, rival in enumerate(attribution.rivals):
        variants = [rows * np.log(left(c) / rest) + np.log(poses) * (c.shape[1] - mine.shape[1]) for c in by_key[rival]]
        best = int(np.argmin(variants))
        np.testing.assert_allclose(attribution.bic_difference[number], variants[best], rtol=1e-6, atol=1e-6)
        angle = np.degrees(subspace_angles(by_key[rival][best], fitted[:, None])[0])
        np.testing.assert_allclose(attribution.angle_deg[number], angle, atol=1e-4)
        assert attribution.rival_parameters[number] == by_key[rival][best].shape[1]


def test_joints_of_one_mechanism_are_one_attribution(fanuc):
    sizes = {"hysteresis@2": [5e-5], "joint_offset@3": [5e-4], "hysteresis@3": [5e-5]}
    campaign = planted(fanuc, sizes, seed=4)
    found = attributed(campaign, *sizes)
    assert [attribution.effect for attribution in found] == ["hysteresis", "joint_offset"]
    assert [member.key for member in found[0].members] == ["hysteresis@2", "hysteresis@3"]
    # The strongest member's: the smallest.
    assert [attribution.p_value for attribution in found] == [0.01, 0.02]
    assert [attribution.found_parameters for attribution in found] == [2, 1]
    # What was found beside it stands for nothing else.
    assert "joint_offset@3" not in found[0].rivals and not {"hysteresis@2", "hysteresis@3"} & set(found[1].rivals)


def test_effects_are_gathered_in_the_order_in_which_their_names_come(fanuc):
    candidates = planted(fanuc, {}, poses=6).candidates
    keys = ["stiffening@3", "joint_offset@2", "stiffening@1", "payload"]
    groups = by_effect([candidates[key] for key in keys])
    assert {name: [member.key for member in members] for name, members in groups.items()} == {
        "stiffening": ["stiffening@3", "stiffening@1"],
        "joint_offset": ["joint_offset@2"],
        "payload": ["payload"],
    }
    assert list(groups) == ["stiffening", "joint_offset", "payload"] and by_effect([]) == {}


RIVALS = {
    "fits as well but makes something else": (UNRELATED_DEG + 1, 1.0, False),
    "fits as well": (UNRELATED_DEG - 1, CONFOUNDED_BIC - 1, True),
    "fits better": (UNRELATED_DEG - 1, -50.0, True),
    "fits worse": (5.0, CONFOUNDED_BIC + 1, False),
}


@pytest.mark.parametrize("rival", RIVALS)
def test_a_rival_is_an_alternative_where_it(rival):
    angle, difference, confounded = RIVALS[rival]
    rivals = np.array([angle]), np.array([difference]), np.array([1])
    found = Attribution("e", (), 0.01, ("other",), *rivals, 2)
    assert found.alternatives == (("other",) if confounded else ())


def test_alternatives_come_with_the_closest_first():
    found = Attribution("e", (), 0.01, ("a", "b", "c"), np.full(3, 50.0), np.array([2.0, -3.0, 1.0]), np.ones(3, int), 1)
    assert found.alternatives == ("b", "c", "a")


def test_confounding_is_the_smallest_angle_between_what_two_candidates_make(fanuc):
    campaign = planted(fanuc, {}, seed=5, poses=12)
    names = ["joint_offset@2", "link_weight@2", "base_compliance", "compensator_stiffness@2", "joint_dependent_stiffness@2"]
    seen = directions(campaign.declared, campaign.observations, [campaign.candidates[name] for name in names])
    angles = confounding(seen)
    count = len(seen.candidates)
    assert angles.shape == (count, count)
    np.testing.assert_array_equal(angles, angles.T)
    np.testing.assert_array_equal(np.diag(angles), 0.0)
    for one in range(count):
        for other in range(one):
            expected = np.degrees(subspace_angles(seen.columns[one], seen.columns[other]).min())
            np.testing.assert_allclose(angles[one, other], expected, atol=1e-4)
    keys = [candidate.key for candidate, _ in seen.candidates]
    aliases = [angles[keys.index(one), keys.index(other)] for one, other in [names[3:]]]
    assert aliases[0] < 5.0


def test_where_nothing_is_tested_nothing_is_confounded(fanuc):
    campaign = planted(fanuc, {}, seed=5, poses=12)
    assert confounding(directions(campaign.declared, campaign.observations, [])).shape == (0, 0)
