"""Forward selection: what is planted is found, alone or in pairs, and nothing is found where nothing is missing."""

from dataclasses import replace

import numpy as np
import pytest
from planted import HAND, planted, two_loads_a_pose
from scipy.stats import binom
from synthetic import NOISE, seen_exactly, with_noise

from elastocal import selection
from elastocal.fitting import fit
from elastocal.screening import directions, score
from elastocal.selection import FAMILY_WISE_LEVEL, parameter_slice, search, without

REPLICATES = 199
NULLS = 16


def searched(campaign, seed=0, **options):
    draws = np.random.default_rng((7, seed))
    return search(campaign.declared, campaign.observations, campaign.all_candidates, REPLICATES, draws, **options)


def keys(found):
    return {candidate.key for candidate in found.effects}


def share_of_plausible(robot, key, share):
    """Parameters of a candidate at a share of their plausible size."""
    candidate = planted(robot, {}, poses=8).candidates[key]
    return np.array([share * parameter.plausible for parameter in candidate.parameters])


# One of each family that has a name of its own in small data.
ONE_OF_EACH_FAMILY = {
    "geometry": "joint_offset@3",
    "gravity": "link_weight@2",
    "transmission": "transmission_harmonic@3[orders 1-2]",
    "elastic": "cross_compliance@2+3",
    "gearbox": "hysteresis@2",
    "drift": "frame_drift",
}


@pytest.mark.parametrize("family", ONE_OF_EACH_FAMILY)
def test_planted_effect_is_found_and_nothing_else(family, fanuc):
    key = ONE_OF_EACH_FAMILY[family]
    size = share_of_plausible(fanuc, key, 0.6)
    campaign = planted(fanuc, {key: size}, seed=1)
    found = searched(campaign)
    assert campaign.candidates[key].family == family
    assert keys(found) == {key}
    assert found.looks[0].scores.p_family[found.looks[0].chosen] < FAMILY_WISE_LEVEL
    # The fit has it too, with the parameters that were planted.
    mine = parameter_slice(found.final, key)
    deviation = np.sqrt(np.diag(found.final.covariance))[mine]
    off = np.abs(found.final.estimate.coefficients[-1] - size) / deviation
    assert (off < 4).all(), off
    assert not found.final.held[mine].any()
    assert found.final.discrepancy_m <= found.declared.discrepancy_m
    assert (found.final.whitened(found.final.residual) ** 2).mean() < 1.3


@pytest.mark.parametrize("pair", [("joint_offset@3", "hysteresis@2"), ("link_weight@2", "frame_drift")])
def test_two_planted_effects_are_both_found(pair, fanuc):
    campaign = planted(fanuc, {key: share_of_plausible(fanuc, key, 0.6) for key in pair}, seed=2)
    found = searched(campaign)
    assert keys(found) == set(pair)
    # Whatever else was taken on the way is not in the final fit.
    assert {effect.key for effect in found.final.model.effects[1:]} == set(pair)


@pytest.fixture(scope="module")
def nothing_missing(fanuc):
    campaigns = [planted(fanuc, {}, seed=100 + number) for number in range(NULLS)]
    return [(campaign, searched(campaign, number)) for number, campaign in enumerate(campaigns)]


def test_nothing_is_found_where_nothing_is_missing(nothing_missing):
    alarms = sum(bool(found.effects) for _, found in nothing_missing)
    assert alarms <= binom.ppf(0.99, NULLS, FAMILY_WISE_LEVEL)


def test_a_search_without_a_find_leaves_the_declared_fit(nothing_missing):
    for _, found in nothing_missing:
        if not found.effects:
            assert found.final is found.declared
            assert len(found.looks) == 1 and found.looks[0].chosen is None


def test_force_scale_is_tested_only_where_compliances_are_nominal(fanuc, nothing_missing):
    """Identified compliances make whatever a wrong scale of the force makes."""
    seen = nothing_missing[0][1].looks[0].directions
    assert "force_scale" not in {candidate.key for candidate, _ in seen.candidates}
    assert "already" in seen.untestable["force_scale"]
    campaign = planted(fanuc, {"force_scale": [0.05]}, seed=3, identified=False)
    seen = directions(campaign.declared, campaign.observations, campaign.all_candidates)
    tested = [candidate.key for candidate, _ in seen.candidates]
    assert "force_scale" in tested and "force_scale" not in seen.untestable
    scores = score(seen, REPLICATES, np.random.default_rng(0))
    assert scores.p_family[tested.index("force_scale")] < FAMILY_WISE_LEVEL


def test_offset_of_a_joint_that_a_fitted_frame_makes_is_not_tested(fanuc):
    """Joint 1 turns the whole robot about an axis of the base."""
    fitted = planted(fanuc, {}, seed=4, fitted_frames=True)
    known = planted(fanuc, {}, seed=4)
    names = {}
    for which, campaign in (("fitted", fitted), ("known", known)):
        seen = directions(campaign.declared, campaign.observations, campaign.all_candidates)
        names[which] = {candidate.key for candidate, _ in seen.candidates}, seen.untestable
    assert "joint_offset@1" in names["known"][0]
    assert "joint_offset@1" not in names["fitted"][0]
    assert "already" in names["fitted"][1]["joint_offset@1"]


def test_candidates_without_their_covariates_are_not_tested(fanuc):
    campaign = planted(fanuc, {}, seed=5)
    bare = replace(
        campaign.observations,
        states=replace(campaign.observations.states, approach=None, time_s=None, temperature_c=None),
    )
    fitted = fit(campaign.declared.model, bare, NOISE, campaign.declared.estimate)
    seen = directions(fitted, bare, campaign.all_candidates)
    assert not {"hysteresis", "frame_drift", "thermal_growth"} & {candidate.effect for candidate, _ in seen.candidates}
    for key, lacking in (("hysteresis@1", "approach"), ("frame_drift", "time"), ("thermal_growth[temperature]", "temperature")):
        assert lacking in seen.untestable[key], seen.untestable[key]


def test_nothing_to_test_finds_nothing(fanuc):
    campaign = planted(fanuc, {"joint_offset@3": [1e-3]}, seed=6, poses=8)
    found = search(campaign.declared, campaign.observations, [], REPLICATES, np.random.default_rng(0))
    assert found.effects == () and found.final is campaign.declared
    assert len(found.looks) == 1 and len(found.looks[0].scores.p_value) == 0


def test_the_same_stream_gives_the_same_search_and_each_look_is_told(fanuc):
    campaign = planted(fanuc, {"joint_offset@3": [3e-4]}, seed=7)
    said = []
    one, other = searched(campaign, 1, progress=said.append), searched(campaign, 1)
    assert keys(one) == keys(other) == {"joint_offset@3"}
    np.testing.assert_array_equal(one.looks[0].scores.p_family, other.looks[0].scores.p_family)
    np.testing.assert_array_equal(one.final.estimate.coefficients[-1], other.final.estimate.coefficients[-1])
    assert len(said) == len(one.looks)
    assert "joint_offset@3" in said[0] and said[-1].endswith("none stands out")


def test_effects_come_with_the_strongest_first(fanuc):
    sizes = {"hysteresis@2": share_of_plausible(fanuc, "hysteresis@2", 0.3), "frame_drift": [2e-3, 0, 0, 0, 0, 0]}
    campaign = planted(fanuc, sizes, seed=8)
    found = searched(campaign)
    statistics = []
    for effect in found.effects:
        mine = parameter_slice(found.final, effect.key)
        values = found.final.estimate.coefficients[[e.key for e in found.final.model.effects].index(effect.key)]
        covariance = found.final.covariance[np.ix_(mine, mine)]
        statistics.append(values @ np.linalg.solve(covariance, values))
    assert len(statistics) == 2
    assert statistics == sorted(statistics, reverse=True)


def test_a_fit_without_its_effects_is_the_fit_that_never_had_them(fanuc):
    """At the noise of the one that has: the discrepancy is taken over."""
    campaign = planted(fanuc, {"joint_offset@3": [5e-4]}, seed=9, targets=HAND)
    offset, tilt = campaign.candidates["joint_offset@3"], campaign.candidates["joint_tilt@2"]
    model, start = campaign.declared.model, campaign.declared.estimate
    both = fit(model.with_effects([offset, tilt]), campaign.observations, NOISE, start.with_effects([offset, tilt]))
    bare = without(both, {"joint_offset@3", "joint_tilt@2"}, campaign.observations)
    again = fit(model, campaign.observations, NOISE, start, both.discrepancy_m)
    assert [effect.key for effect in bare.model.effects] == [effect.key for effect in model.effects]
    assert bare.discrepancy_m == both.discrepancy_m
    np.testing.assert_allclose(bare.estimate.coefficients[0], again.estimate.coefficients[0], rtol=1e-4)
    one = without(both, {"joint_tilt@2"}, campaign.observations)
    assert [effect.key for effect in one.model.effects][1:] == ["joint_offset@3"]


def test_parameters_of_an_effect_stand_where_the_fit_lists_them(fanuc):
    campaign = planted(fanuc, {}, seed=10, poses=8, fitted_frames=True)
    drift = campaign.candidates["frame_drift"]
    fitted = fit(
        campaign.declared.model.with_effects([drift]),
        campaign.observations,
        NOISE,
        campaign.declared.estimate.with_effects([drift]),
    )
    springs, mine = parameter_slice(fitted, "joint_compliance"), parameter_slice(fitted, "frame_drift")
    assert springs.tolist() == list(range(6, 12))
    assert mine.tolist() == list(range(12, 12 + len(drift.parameters)))
    assert [fitted.parameters[index][1].name for index in mine] == [parameter.name for parameter in drift.parameters]
    assert len(parameter_slice(fitted, "not there")) == 0


def shapes_of(found):
    """Shape of the last effect of the final fit, and the standard error of its coefficient beside it."""
    (coefficient, _) = parameter_slice(found.final, found.effects[0].key)
    deviation = np.sqrt(found.final.covariance[coefficient, coefficient])
    return found.final.estimate.coefficients[-1][0], deviation, found.final.estimate.shapes[-1][0]


@pytest.mark.parametrize("size", [3e-5, 6e-5, 1e-4])
def test_thermal_growth_whose_lag_cannot_be_told_is_not_dropped(size, fanuc):
    """Within an hour a lag of an hour is hardly told from others: nor is the growth in the end, but that there is some."""
    states = two_loads_a_pose(6, 25, (5, 1))
    campaign = planted(fanuc, {"thermal_growth[time]": [size]}, seed=1, states=replace(states, time_s=states.time_s / 4))
    found = searched(campaign)
    assert keys(found) == {"thermal_growth[time]"}
    growth, deviation, _ = shapes_of(found)
    # Without the lag known, the growth is none that could not be chance.
    assert 0 < growth < 2.5 * deviation


@pytest.mark.parametrize("size", [1e-4, 2e-4])
def test_play_that_is_as_good_as_a_straight_line_is_not_dropped(size, fanuc):
    states = two_loads_a_pose(6, 25, (5, 1), force=50.0)
    campaign = planted(fanuc, {}, seed=1, states=states, identified=False)
    play = campaign.candidates["lost_motion@2"]
    bare = campaign.declared
    model, true = bare.model.with_effects([play]), bare.estimate.with_effects([play])
    true.coefficients[-1][:], true.shapes[-1][:] = size, 390.0
    seen = with_noise(seen_exactly(model, true, states), np.random.default_rng((6, 1)))
    declared = fit(bare.model, seen, bare.noise, bare.estimate)
    found = search(declared, seen, [play], REPLICATES, np.random.default_rng(0))
    assert keys(found) == {"lost_motion@2"}
    value, _, torque = shapes_of(found)
    assert value / torque == pytest.approx(size / 390.0, rel=0.25)


def test_an_effect_of_two_poses_in_twenty_is_found(fanuc):
    states = two_loads_a_pose(6, 20, (5, 2))
    few = replace(states, approach=states.approach * np.isin(states.pose, (3, 11))[:, None])
    found = searched(planted(fanuc, {"hysteresis@2": [3e-4]}, seed=2, states=few))
    assert keys(found) == {"hysteresis@2"}


@pytest.fixture(scope="module")
def pair(fanuc):
    return planted(fanuc, {key: share_of_plausible(fanuc, key, 0.6) for key in ("joint_offset@3", "hysteresis@2")}, seed=2)


@pytest.mark.parametrize(("further", "number"), [(-1.0, 1), (1.0, 2)])
def test_a_further_effect_must_be_worth_its_parameters_and_a_first_one_need_not(further, number, pair, monkeypatch):
    """Looks at the real candidates in their order, but all of them worth a little less or more than nothing."""
    looks = []

    def scored(*given):
        scores = score(*given)
        looks.append(scores)
        return replace(scores, bic_gain=1e-6 * scores.bic_gain + (-1.0 if len(looks) == 1 else further))

    monkeypatch.setattr(selection, "score", scored)
    found = searched(pair)
    assert len(found.effects) == number and keys(found) <= {"joint_offset@3", "hysteresis@2"}
    # What was left out stood out beyond chance.
    assert looks[1].p_family.min() < FAMILY_WISE_LEVEL


@pytest.mark.parametrize(
    ("gain", "sure", "chosen"), [(0.1, np.inf, True), (-0.1, np.inf, False), (-0.1, selection.SURE_GAIN, True)]
)
def test_what_is_chosen_predicts_left_out_poses_better_or_is_beyond_any_doubt(gain, sure, chosen, pair, monkeypatch):
    monkeypatch.setattr(selection, "SURE_GAIN", sure)
    monkeypatch.setattr(selection, "cross_validated_gains", lambda *_: (np.array([gain]), np.array([5.0])))
    first = searched(pair).looks[0]
    assert (first.chosen is not None) == chosen
    if chosen:
        assert (first.gain, first.gain_std_error) == (gain, 5.0)
    else:
        # All that stand out are refused by name.
        out = {
            c.key
            for (c, _), p in zip(first.directions.candidates, first.scores.p_family, strict=True)
            if p < selection.FAMILY_WISE_LEVEL
        }
        assert set(first.refused) == out and "joint_offset@3" in out


def test_a_candidate_that_was_dropped_as_needless_is_not_looked_at_again(pair, monkeypatch):
    """Though it is there: what stands for it has once been found to be enough."""
    seen_before, dropped = [], []

    def simpler(declared, current, observations, found, candidates):
        if len(found) < 2 or dropped:
            return []
        dropped.extend(candidate.key for candidate in found[1:])
        return [(found[0], [])]

    def looked(current, observations, candidates):
        seen_before.append((list(dropped), {candidate.key for candidate in candidates}))
        return directions(current, observations, candidates)

    monkeypatch.setattr(selection, "_simpler", simpler)
    monkeypatch.setattr(selection, "directions", looked)
    found = searched(pair)
    assert dropped and not set(dropped) & keys(found)
    (_, first), *later = seen_before
    assert set(dropped) <= first and later
    for gone, candidates in later:
        assert gone == dropped and not set(dropped) & candidates
    # What is missing in its place is something else, or nothing.
    assert found.looks[0].directions.candidates[found.looks[0].chosen][0].key in keys(found)


def test_of_two_names_for_one_law_that_of_fewer_places_is_taken(fanuc):
    """A compensator's torque and the first two harmonics of its joint are the same functions; each joint has harmonics."""
    planted_torque = [3e-4, -2e-4, 1e-4, 1e-4]
    for seed in range(3):
        campaign = planted(fanuc, {"compensator_torque@2": planted_torque}, seed=seed)
        found = search(campaign.declared, campaign.observations, campaign.all_candidates, 199, np.random.default_rng(seed))
        assert keys(found) == {"compensator_torque@2"}
