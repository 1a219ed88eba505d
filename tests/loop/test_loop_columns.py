"""Readings and estimates to tables and back: what a later step reads is what an earlier one had."""

from dataclasses import replace

import numpy as np
import pytest
from elastocal.attribution import Attribution
from elastocal.loop.conclude import attributions_from, candidate_columns
from elastocal.loop.search_columns import found_columns, look_blocks, rival_blocks
from elastocal.selection import Search, search
from made_folders import made_folder, made_table
from support import chain_of
from synthetic import NOISE, made_estimate, made_model

from elastocal.campaign import Target, read_campaign
from elastocal.effects.catalogue import candidates_on
from elastocal.fitting import Fit, fit
from elastocal.loop.case import case_from, noise_facts, noise_from
from elastocal.loop.fit_columns import correlation_columns, estimate_from, parameter_columns
from elastocal.loop.intake import taken_in
from elastocal.loop.reading_columns import reading_columns, readings_from
from elastocal.loop.schemas import CORRELATIONS, FOUND, LOOKS, PARAMETERS, RIVALS, readings
from elastocal.model import parameters
from elastocal.noise import Noise
from elastocal.storage import read_table, write_table

COVARIATES = {
    "none": {},
    "all": {"approach3": [1.0, -1.0], "time_s": [0.0, 5.0], "temperature_c": [20.0, 21.5]},
}


def there_and_back(path, schema, columns):
    write_table(path, schema, [columns], {})
    return read_table(path, schema)


@pytest.mark.parametrize("measured", ["position", "pose"])
@pytest.mark.parametrize("covariates", COVARIATES)
def test_readings_come_back_as_they_were(measured, covariates, kuka, config_folder, tmp_path):
    table = made_table(kuka, "c")
    count = len(table["pose"])
    table |= {name: np.resize(values, count) for name, values in COVARIATES[covariates].items()}
    table |= {f"approach{joint}": np.zeros(count) for joint in range(1, 7) if joint != 3 and covariates == "all"}
    table["session"] = table["pose"] % 2
    folder = made_folder(tmp_path / "c", kuka, table=table, measured=measured)
    before = read_campaign(folder, config_folder / "robots").readings
    assert (before.rotation_vector is None) == (measured == "position")
    assert (before.approach is None) == (before.time_s is None) == (covariates == "none")
    after = readings_from(there_and_back(tmp_path / "r.parquet", readings(6), reading_columns(before)))
    for name, values in vars(before).items():
        if values is None:
            assert getattr(after, name) is None, name
        else:
            np.testing.assert_array_equal(getattr(after, name), values)
            assert getattr(after, name).dtype == values.dtype, name


MODELS = {
    "frames, targets, springs": (dict(fitted_frames=True, rows=6, identified=True), ()),
    "positions": (dict(fitted_frames=True, rows=3, identified=True), ("joint_offset@1",)),
    "nothing but effects": (dict(fitted_frames=False, rows=3), ("lost_motion@2", "frame_drift", "stiffening@1")),
    "nothing": (dict(fitted_frames=False, rows=3), ()),
}
TARGETS = (Target("A", "hand", None), Target("known", "elbow", (0.1, 0.0, -0.2)), Target("b c", "elbow", None))


@pytest.mark.parametrize("kind", MODELS)
def test_estimates_come_back_from_their_table(kind, tmp_path):
    settings, keys = MODELS[kind]
    chain = chain_of("Tz(0.4) Rz(q1) Tx(0.1) Ry(q2) Tx(0.7) [elbow] Ry(q3) Tx(0.6) [hand]")
    model = made_model(chain, TARGETS if settings["fitted_frames"] else TARGETS[1:2], **settings)
    model = model.with_effects([candidates_on(model.sites)[key] for key in keys])
    estimate = made_estimate(model, sessions=(0, 7) if settings["fitted_frames"] else (0,), seed=1)
    count = len(parameters(model, estimate))
    held = np.arange(count) % 3 == 0
    covariance = np.diag(np.arange(count, dtype=float) * ~held)
    fitted = Fit(model, estimate, NOISE, 3e-5, held, covariance, np.ones(1), None, np.zeros((1, 3)), None, None)
    columns = there_and_back(tmp_path / "p.parquet", PARAMETERS, parameter_columns(fitted))
    back, discrepancy = estimate_from(columns, model, estimate.sessions)
    assert discrepancy == 3e-5 and back.sessions == estimate.sessions
    for name in ("frame_rotation", "frame_position", "target_offset", "target_rotation"):
        np.testing.assert_allclose(getattr(back, name), getattr(estimate, name), atol=1e-14, err_msg=name)
    for name in ("coefficients", "shapes"):
        for one, other in zip(getattr(back, name), getattr(estimate, name), strict=True):
            np.testing.assert_array_equal(one, other)
    assert columns["held"].tolist() == [*held, False]
    np.testing.assert_allclose(columns["std_error"][:-1], np.sqrt(np.diag(covariance)))
    assert (columns["owner"][-1], columns["parameter"][-1], columns["unit"][-1]) == ("fit", "discrepancy", "m")
    assert np.isnan(columns["std_error"][-1])


@pytest.fixture(scope="module")
def traced(kuka, config_folder, tmp_path_factory):
    """A campaign with an offset of joint 3: the case, its declared fit and what a search found."""
    folder = tmp_path_factory.mktemp("loop") / "made"
    made_folder(folder, kuka, table=made_table(kuka, "made", offset_of_joint_3=1e-3), frame="tracker", measured="pose")
    descriptions, training, _ = taken_in(folder, config_folder / "robots")
    case = case_from(descriptions, reading_columns(training))
    noise = Noise("declared", 6e-5, 6e-5, np.zeros(6))
    declared = fit(case.model, case.observations, noise)
    return case, declared, search(declared, case.observations, list(case.candidates.values()), 199, np.random.default_rng(0))


def test_a_fit_comes_back_from_its_table(traced, tmp_path):
    case, _, found = traced
    assert [candidate.key for candidate in found.effects] == ["joint_offset@3"]
    table = there_and_back(tmp_path / "p.parquet", PARAMETERS, parameter_columns(found.final))
    model, effects = case.with_found(["joint_offset@3"])
    assert effects == list(found.effects)
    again = case.fitted(model, table, noise_from({"noise": noise_facts(found.final.noise)}))
    deviation = np.where(found.final.held, 1.0, np.sqrt(np.diag(found.final.covariance)))
    once_more = parameter_columns(again)
    np.testing.assert_array_less(np.abs(once_more["value"][:-1] - table["value"][:-1]), 0.01 * deviation)
    np.testing.assert_allclose(once_more["std_error"][:-1], table["std_error"][:-1], rtol=1e-3)
    np.testing.assert_array_equal(once_more["held"], table["held"])
    assert again.discrepancy_m == found.final.discrepancy_m
    np.testing.assert_allclose(again.residual, found.final.residual, atol=1e-8)


def test_noise_comes_back_from_its_document():
    noise = Noise("repeats", 1e-5, 2e-5, np.array([1e-6, 0, 3e-6]), 77)
    back = noise_from({"noise": noise_facts(noise), "warnings": []})
    np.testing.assert_array_equal(back.joint_rad, noise.joint_rad)
    assert replace(back, joint_rad=None) == replace(noise, joint_rad=None)


def test_correlations_are_of_every_pair_that_is_not_held(traced, tmp_path):
    _, declared, _ = traced
    table = there_and_back(tmp_path / "c.parquet", CORRELATIONS, correlation_columns(declared))
    free = int((~declared.held).sum())
    assert len(table["one"]) == free * (free - 1) // 2
    assert (np.abs(table["correlation"]) <= 1).all()
    names = [f"{owner} {parameter.name}" for owner, parameter in declared.parameters]
    for one, other, value in list(zip(table["one"], table["other"], table["correlation"], strict=True))[::50]:
        i, j = names.index(one), names.index(other)
        expected = declared.covariance[i, j] / np.sqrt(declared.covariance[i, i] * declared.covariance[j, j])
        assert value == pytest.approx(expected)


def test_every_candidate_is_in_the_first_look_tested_or_with_a_reason(traced, tmp_path):
    case, _, found = traced
    path = tmp_path / "l.parquet"
    write_table(path, LOOKS, look_blocks(found.looks, case.candidates), {})
    table = read_table(path, LOOKS)
    first = table["look"] == 0
    assert set(table["candidate"][first]) == set(case.candidates)
    tested = np.isfinite(table["p_value"])
    assert (tested | (table["note"] != "")).all()
    assert not np.isfinite(table["p_family"][~tested]).any()
    assert list(table["candidate"][table["chosen"]]) == [
        look.directions.candidates[look.chosen][0].key for look in found.looks if look.chosen is not None
    ]
    assert table["look"].max() == len(found.looks) - 1
    for key, joints in zip(table["candidate"], table["joints"], strict=True):
        assert joints == "+".join(map(str, case.candidates[key].joints))


def test_found_effects_have_the_p_value_with_which_they_were_chosen(traced, tmp_path):
    case, declared, found = traced
    table = there_and_back(tmp_path / "f.parquet", FOUND, found_columns(found))
    look = found.looks[0]
    assert table["candidate"].tolist() == ["joint_offset@3"] and table["family"].tolist() == ["geometry"]
    assert table["p_family"][0] == look.scores.p_family[look.chosen] == 1 / 200
    assert table["gain"][0] == look.gain > table["gain_std_error"][0] == look.gain_std_error
    # One that stands for several was chosen in no look.
    other = replace(found, effects=(case.candidates["joint_offset@2"],))
    assert found_columns(other)["p_family"][0] == table["p_family"][0]
    nothing = there_and_back(tmp_path / "n.parquet", FOUND, found_columns(Search((), declared, declared)))
    assert {name: len(values) for name, values in nothing.items()} == dict.fromkeys(nothing, 0)


def test_attributions_come_back_from_the_rivals(traced, tmp_path):
    case, _, _ = traced
    members = tuple(case.candidates[key] for key in ("joint_offset@3", "hysteresis@1", "hysteresis@2"))
    numbers = np.array([30.0, 5.0]), np.array([1.0, 40.0]), np.array([1, 2])
    made = [
        Attribution("joint_offset", members[:1], 0.01, ("payload", "link_weight@3"), *numbers, 1),
        Attribution("hysteresis", members[1:], 0.02, ("joint_offset@2", "payload"), *numbers, 2),
    ]
    write_table(tmp_path / "r.parquet", RIVALS, rival_blocks(made), {})
    table = read_table(tmp_path / "r.parquet", RIVALS)
    back = attributions_from(table, members, {"joint_offset@3": 0.01, "hysteresis@1": 0.03, "hysteresis@2": 0.02})
    for one, other in zip(back, made, strict=True):
        assert (one.effect, one.members, one.p_value, one.rivals) == (other.effect, other.members, other.p_value, other.rivals)
        assert one.alternatives == other.alternatives
        assert one.found_parameters == other.found_parameters
    assert table["alternative"].tolist() == [True, False, True, False]


def test_candidates_table_is_the_first_look_with_the_nearest_angle(traced, tmp_path):
    case, _, found = traced
    write_table(tmp_path / "l.parquet", LOOKS, look_blocks(found.looks, case.candidates), {})
    looks = read_table(tmp_path / "l.parquet", LOOKS)
    rivals = {"candidate": np.array(["payload", "payload", "hysteresis@1"]), "angle_deg": np.array([40.0, 30.0, 80.0])}
    columns = candidate_columns(looks, rivals)
    angle = dict(zip(columns["candidate"], columns["angle_deg"], strict=True))
    assert angle["payload"] == 30.0 and angle["hysteresis@1"] == 80.0 and np.isnan(angle["joint_offset@3"])
    assert len(columns["candidate"]) == (looks["look"] == 0).sum()
    assert set(columns["candidate"][columns["chosen"]]) == {"joint_offset@3"}
