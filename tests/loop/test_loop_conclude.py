"""The verdict's document: its figures are those of the fits, and it is plain JSON whatever is missing."""

import json
from dataclasses import replace

import numpy as np
import pytest
from made_folders import PLAN, made_folder, made_table

from elastocal.attribution import Attribution
from elastocal.fitting import fit
from elastocal.lack_of_fit import lack_of_fit
from elastocal.loop.case import case_from, noise_facts
from elastocal.loop.conclude import concluded
from elastocal.loop.declared import noise_of
from elastocal.loop.experiment import proposal_frame
from elastocal.loop.intake import taken_in
from elastocal.loop.reading_columns import reading_columns
from elastocal.noise import Noise

NOISE = Noise("declared", 6e-5, 6e-5, np.zeros(6))
KEYS = ("joint_offset@3", "payload")
ROWS = [
    {"kind": "frames", "step": "frames and targets", "heldout_rms_m": 9e-4},
    {"kind": "declared", "step": "declared model", "heldout_rms_m": 8e-4},
    {"kind": "effect", "step": "+ joint_offset", "heldout_rms_m": 2e-4},
    {"kind": "effect", "step": "+ payload", "heldout_rms_m": 1e-4},
    {"kind": "control", "step": "control: x", "heldout_rms_m": 7e-4},
]
LOOKS = {
    "look": np.array([0, 0, 0, 1]),
    "candidate": np.array(["a", "b", "c", "a"]),
    "p_value": np.array([0.1, np.nan, 0.2, 0.3]),
}
FAULT = {
    "name": "wrong_unit",
    "detail": "degrees for radians",
    "joints": [2],
    "parameters": [{"name": "factor", "value": 57.3, "unit": ""}],
    "decisive": True,
    "alternatives": ("gradians for radians",),
}


@pytest.fixture(scope="module")
def case(kuka, config_folder, tmp_path_factory):
    folder = tmp_path_factory.mktemp("conclude") / "made"
    made_folder(folder, kuka, table=made_table(kuka, "made", offset_of_joint_3=1e-3))
    descriptions, training, _ = taken_in(folder, config_folder / "robots")
    return case_from(descriptions, reading_columns(training))


@pytest.fixture(scope="module")
def fits(case):
    declared = fit(case.model, case.observations, NOISE)
    model, effects = case.with_found(KEYS)
    return declared, fit(model, case.observations, NOISE, declared.estimate.with_effects(effects))


def attribution(case, key, *alternatives, angles=()):
    count = len(alternatives)
    candidate = case.candidates[key]
    angles = np.array(angles) if angles else np.full(count, 50.0)
    return Attribution(candidate.effect, (candidate,), 0.01, alternatives, angles, np.zeros(count), np.ones(count, int), 1)


def said(case, fits, attributions=(), doubts=(), faults=(), warnings=(), noise=NOISE, looks=LOOKS):
    facts = {"noise": noise_facts(noise), "warnings": ["of the noise"]}
    judged = ROWS, {"poses": 4}, faults, list(warnings), (0.5, 0.1)
    verdict = concluded(case, facts, *fits, attributions, doubts, looks, *judged)
    return json.loads(json.dumps(verdict, allow_nan=False))


def test_effects_have_the_figures_of_the_final_fit(case, fits):
    verdict = said(case, fits, [attribution(case, "joint_offset@3"), attribution(case, "payload")])
    assert verdict["verdict"] == "several" and verdict["campaign"] == "made"
    offset, payload = verdict["effects"]
    _, final = fits
    (parameter,) = offset["parameters"]
    place = [owner for owner, _ in final.parameters].index("joint_offset@3")
    assert parameter["value"] == final.estimate.coefficients[1][0]
    assert parameter["std_error"] == pytest.approx(np.sqrt(final.covariance[place, place]))
    assert parameter["unit"] == "rad" and parameter["held"] is False
    assert [p["value"] for p in payload["parameters"]] == final.estimate.coefficients[2].tolist()
    assert (offset["joints"], offset["members"], offset["p_value"]) == ([3], ["joint_offset@3"], 0.01)
    # Shares of what the step before left.
    assert offset["heldout_gain"] == pytest.approx(0.75) and payload["heldout_gain"] == pytest.approx(0.5)
    assert offset["angle_to_nearest_deg"] is None
    assert offset["doubts"] == payload["doubts"] == []


def test_compliances_and_lack_of_fit_are_those_of_both_fits(case, fits):
    verdict = said(case, fits, [attribution(case, "joint_offset@3")])
    declared, final = fits
    found = verdict["compliance_urad_per_Nm"]
    np.testing.assert_allclose(found["before"], 1e6 * declared.estimate.coefficients[0])
    np.testing.assert_allclose(found["after"], 1e6 * final.estimate.coefficients[0])
    np.testing.assert_allclose(found["std_error"], 1e6 * np.sqrt(np.diag(final.covariance))[:6])
    for stage, fitted in (("before", declared), ("after", final)):
        expected = lack_of_fit(fitted, case.observations)
        assert verdict["lack_of_fit"][stage]["mean_square_over_noise"] == pytest.approx(expected.ratio)
        assert verdict["lack_of_fit"][stage]["rejected"] == expected.rejected
    assert verdict["lack_of_fit"]["before"]["rejected"] and not verdict["lack_of_fit"]["after"]["rejected"]
    assert verdict["candidates_tested"] == 2
    assert 0 <= verdict["predictable_share"]["after"] <= 1


def test_alternatives_make_a_class(case, fits):
    verdict = said(case, fits, [attribution(case, "joint_offset@3", "payload", "link_weight@2", angles=(30.0, 50.0))])
    assert verdict["verdict"] == "class"
    assert set(verdict["effects"][0]["alternatives"]) == {"payload", "link_weight@2"}
    assert verdict["effects"][0]["angle_to_nearest_deg"] == 30.0


def test_a_doubt_makes_a_class_and_a_warning_and_stands_with_its_effect(case, fits):
    doubt = {"effect": "joint_offset@3", "departure": "its size goes with the load", "p_value": 0.001}
    verdict = said(case, fits, [attribution(case, "joint_offset@3")], [doubt])
    assert verdict["verdict"] == "class"
    assert verdict["effects"][0]["doubts"] == [doubt] and verdict["effects"][0]["alternatives"] == []
    (warning,) = (text for text in verdict["warnings"] if "joint_offset@3" in text)
    assert "departs from its law, its size goes with the load" in warning
    without = said(case, fits, [attribution(case, "joint_offset@3")])
    assert without["verdict"] == "named" and without["warnings"] == ["of the noise"]
    _, payload = said(case, fits, [attribution(case, "joint_offset@3"), attribution(case, "payload")], [doubt])["effects"]
    assert payload["doubts"] == []


def test_a_fault_of_the_data_comes_before_all_physics(case, fits):
    doubt = FAULT | {"name": "outliers", "decisive": False, "detail": "two rows"}
    verdict = said(case, (fits[0], fits[0]), faults=[FAULT, doubt])
    assert verdict["verdict"] == "named"
    (effect,) = verdict["effects"]
    assert (effect["name"], effect["family"], effect["joints"]) == ("wrong_unit", "data", [2])
    assert effect["parameters"] == [{"name": "factor", "value": 57.3, "unit": "", "std_error": None}]
    assert effect["alternatives"] == ["gradians for radians"] and effect["doubts"] == []
    assert "outliers: two rows" in verdict["warnings"]


def test_what_remains_is_a_warning(case, fits):
    declared, _ = fits
    nothing = said(case, (declared, declared), warnings=["of the judgement"])
    assert nothing["verdict"] == "unexplained"
    assert nothing["warnings"][:2] == ["of the noise", "of the judgement"]
    # The compliance takes up what it can of the offset that the model lacks.
    assert "joint 3" in nothing["warnings"][2] and "negative" in nothing["warnings"][2]
    assert "no effect of the catalogue stands out" in nothing["warnings"][3]
    model, effects = case.with_found(["payload"])
    little = fit(model, case.observations, NOISE, declared.estimate.with_effects(effects))
    wrong = said(case, (declared, little), [attribution(case, "payload")])
    assert wrong["verdict"] == "unexplained" and wrong["lack_of_fit"]["explained_share"] < 0.5
    assert "something else is still missing" in wrong["warnings"][-1]


def test_a_fit_that_lacks_nothing_is_adequate_and_one_without_tests_not_testable(case, fits):
    _, final = fits
    fine = said(case, (final, final))
    assert fine["verdict"] == "adequate" and fine["effects"] == [] and fine["warnings"] == ["of the noise"]
    none = {name: values[:0] for name, values in LOOKS.items()}
    assert said(case, (final, final), looks=none)["verdict"] == "not_testable"


def test_unknown_noise_is_null_and_not_a_number_nowhere(case, fits):
    unknown = replace(NOISE, source="residual")
    verdict = said(case, [replace(fitted, noise=unknown) for fitted in fits], noise=unknown)
    assert verdict["lack_of_fit"]["before"] == {"mean_square_over_noise": None, "p_value": None, "rejected": False}
    assert verdict["noise"]["source"] == "residual"


def test_a_wild_repeat_is_not_in_the_means(kuka, config_folder, tmp_path):
    table = made_table(kuka, "made", plan=replace(PLAN, repeats=4))
    repeated = np.flatnonzero(table["repeat"] == 3)
    observations = []
    for name, off in (("clean", 0.0), ("wild", 0.01)):
        moved = table["x"].copy()
        moved[repeated] += off * (np.arange(len(repeated)) % 4 == 0)
        made_folder(tmp_path / name, kuka, table=table | {"x": moved})
        descriptions, training, _ = taken_in(tmp_path / name, config_folder / "robots")
        observations.append(case_from(descriptions, reading_columns(training)).observations)
    clean, wild = observations
    shifted = np.abs(wild.position - clean.position).max(axis=1)
    # The means lose one of four repeats, each 60 µm off or so, and not a share of ten millimetres.
    assert 2 <= np.count_nonzero(shifted) < len(shifted) and shifted.max() < 2e-4


def test_noise_is_of_repeats_as_declared_or_of_the_residual(case):
    """Eight contrasts of positions from four poses with two approaches each under two loads."""
    repeated = noise_of(case)["noise"]
    assert repeated["source"] == "repeats" and repeated["degrees_of_freedom"] > 0
    one = case.campaign.readings.select(case.campaign.readings.repeat == 0)
    single = replace(case, campaign=replace(case.campaign, readings=one))
    declared = noise_of(single)
    assert declared["noise"]["source"] == "declared" and declared["noise"]["position_m"] == 6e-5
    neither = noise_of(replace(single, campaign=replace(single.campaign, noise=None)))
    assert neither["noise"]["source"] == "residual" and neither["warnings"]
    # The offset that the declared model lacks is in it.
    assert neither["noise"]["position_m"] > 1e-4
    json.dumps([declared, neither], allow_nan=False)


def test_the_next_experiment_is_a_table_for_whoever_drives_the_robot(case, fits):
    """Angles as the controller reports them, as many states as asked for each confounded effect."""
    _, final = fits
    found = [attribution(case, "joint_offset@3", "link_weight@3"), attribution(case, "payload")]
    frame = proposal_frame(case, final, found, 2, np.random.default_rng(0))
    assert frame.effect.tolist() == ["joint_offset"] * 2 and frame.pose.tolist() == [0, 1]
    assert (frame.separation.diff()[1:] > 0).all() and (frame.separation > frame.separation_without).all()
    robot = case.campaign.robot
    turned = replace(robot, reported_matrix=np.diag([1.0, -1, 1, 1, 1, 2]), reported_offset=np.array([0, 0.5, 0, 0, 0, 0]))
    other = replace(case, campaign=replace(case.campaign, robot=turned))
    again = proposal_frame(other, final, found, 2, np.random.default_rng(0))
    np.testing.assert_allclose(again.q2, 0.5 - frame.q2)
    np.testing.assert_allclose(again.q6, frame.q6 / 2)
    np.testing.assert_allclose(again.q1, frame.q1)
    assert proposal_frame(case, final, found[1:], 2, np.random.default_rng(0)).empty
