"""A model file holds the whole robot: read again, it predicts and bounds errors alike."""

import json
from dataclasses import replace

import jsonschema
import numpy as np
import pytest
from made_loop_tables import CAMPAIGNS
from made_models import (
    ROBOTS,
    draw_commands,
    make_calibrated,
    make_choice,
    write_made_model,
)

from elastocal.application.accuracy import predict_errors
from elastocal.application.calibrated import ResidualModel, predict_poses
from elastocal.application.model_file import (
    build_model_schema,
    describe_model,
    read_model_file,
    restore_calibrated,
    write_model,
)
from elastocal.application.scope import set_form_error
from elastocal.effects.formulas import derive_formulas
from elastocal.errors import InputError
from elastocal.residual_model.regressions import Predictor


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """A robot and its model file."""
    calibrated = make_calibrated("kuka")
    path = tmp_path_factory.mktemp("model") / "arm.elastocal.json"
    return calibrated, write_made_model(path, calibrated)


def read_again(path):
    return restore_calibrated(read_model_file(path), path)


@pytest.mark.parametrize("name", ROBOTS)
def test_a_file_gives_the_same_poses(name, tmp_path):
    calibrated = make_calibrated(name)
    restored = read_again(write_made_model(tmp_path / "arm.json", calibrated))
    commands = draw_commands(calibrated)
    for first, second in zip(
        predict_poses(calibrated, *commands),
        predict_poses(restored, *commands),
        strict=True,
    ):
        np.testing.assert_allclose(first, second, atol=1e-12)


@pytest.mark.parametrize(
    "regression",
    ["", "two_joints", pytest.param("extra_trees", marks=pytest.mark.slow)],
)
def test_a_file_gives_the_same_errors_and_bounds(regression, tmp_path):
    calibrated = make_calibrated("kuka", regression)
    calibrated = set_form_error(calibrated, 3e-5, contradicted=True)
    restored = read_again(write_made_model(tmp_path / "arm.json", calibrated))
    commands = draw_commands(calibrated, 20)
    first = predict_errors(calibrated, *commands)
    second = predict_errors(restored, *commands)
    for name in ("parameters_m", "regression_m", "form_m", "left_out_m", "bound_m"):
        expected = getattr(first, name)
        np.testing.assert_allclose(getattr(second, name), expected, rtol=1e-9)
    assert first.left_out_m.all()
    assert first.regression_m.any() == bool(regression)
    assert restored.scope.left_out == calibrated.scope.left_out == ("hysteresis@2",)
    np.testing.assert_allclose(
        predict_poses(restored, *commands)[0],
        predict_poses(calibrated, *commands)[0],
        atol=1e-12,
    )


def test_a_file_follows_its_schema_and_keeps_the_verdict(written):
    path = written[1]
    document = json.loads(path.read_text("utf-8"))
    jsonschema.validate(document, build_model_schema())
    assert read_model_file(path).verdict == CAMPAIGNS["named"]
    assert document["format"] == "elastocal model" and document["version"] == 1


def test_unknown_values_of_the_states_are_kept(tmp_path):
    calibrated = make_calibrated("kuka")
    fit = calibrated.fit
    temperature_c = fit.observations.states.temperature_c.copy()
    temperature_c[3] = np.nan
    states = replace(fit.observations.states, temperature_c=temperature_c, time_s=None)
    observations = replace(fit.observations, states=states)
    calibrated = replace(calibrated, fit=replace(fit, observations=observations))
    path = write_made_model(tmp_path / "arm.json", calibrated)
    restored = read_again(path).states
    assert restored.time_s is None
    np.testing.assert_array_equal(restored.temperature_c, temperature_c)


def test_an_arm_that_bears_its_usual_weight_is_restored(tmp_path):
    calibrated = make_calibrated("kuka")
    fit = calibrated.fit
    sites = replace(fit.model.sites, bears_typical_weight=True)
    calibrated = replace(
        calibrated,
        model=replace(calibrated.model, sites=sites),
        fit=replace(fit, model=replace(fit.model, sites=sites)),
    )
    path = write_made_model(tmp_path / "arm.json", calibrated)
    assert not any(b.loads_joints for b in read_model_file(path).kinematics.bodies)
    commands = draw_commands(calibrated, 20)
    np.testing.assert_allclose(
        predict_poses(read_again(path), *commands)[0],
        predict_poses(calibrated, *commands)[0],
        atol=1e-12,
    )


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"format": "verdict"}, "no model file"),
        ({"version": 2}, "version.*found 2.*version 1"),
        ({"kept": 1}, "kept"),
        ({"springs": [{"coordinate": "a", "value": 1.0}]}, "springs"),
    ],
)
def test_another_file_is_refused_in_a_line(written, tmp_path, change, message):
    document = json.loads(written[1].read_text("utf-8")) | change
    path = tmp_path / "changed.json"
    path.write_text(json.dumps(document), "utf-8")
    with pytest.raises(InputError, match=message) as refusal:
        read_model_file(path)
    assert "\n" not in str(refusal.value)


def list_places(value, place=()):
    """Places of all values in a document."""
    yield place
    entries = ()
    if isinstance(value, dict):
        entries = value.items()
    elif isinstance(value, list):
        entries = enumerate(value[:2])
    for key, entry in entries:
        yield from list_places(entry, (*place, key))


def test_a_process_is_fitted_again_with_the_same_hyperparameters(tmp_path):
    calibrated = make_calibrated("kuka", "gaussian_process")
    path = write_made_model(tmp_path / "arm.json", calibrated)
    setting = read_model_file(path).fit.regression.choice.setting
    expected = calibrated.residual_model.predictor.law().setting
    assert setting["variance"] == expected["variance"]
    assert setting["noise"] == expected["noise"]
    finite = np.isfinite(expected["lengths"])
    np.testing.assert_array_equal(
        np.array(setting["lengths"])[finite], expected["lengths"][finite]
    )
    commands = draw_commands(calibrated, 50)
    np.testing.assert_allclose(
        predict_poses(read_again(path), *commands)[0],
        predict_poses(calibrated, *commands)[0],
        atol=1e-12,
    )


@pytest.mark.slow
def test_a_model_file_of_any_contents_is_read_or_refused_in_a_line(written, tmp_path):
    """Single values of a file are replaced at random."""
    document = json.loads(written[1].read_text("utf-8"))
    places = [place for place in list_places(document) if place]
    stream = np.random.default_rng(7)
    path = tmp_path / "changed.json"
    refused = 0
    for number in stream.permutation(len(places))[:60]:
        changed = json.loads(written[1].read_text("utf-8"))
        parent = changed
        for key in places[number][:-1]:
            parent = parent[key]
        values = [None, -1, 1e9, "x", [], {}, [[1.0]]]
        parent[places[number][-1]] = values[stream.integers(len(values))]
        path.write_text(json.dumps(changed), "utf-8")
        try:
            read_again(path)
        except InputError as refusal:
            assert "\n" not in str(refusal)
            refused += 1
    assert refused > 40


def test_an_effect_of_a_missing_plug_in_is_named(written):
    contents = read_model_file(written[1])
    contents.fit.model["effects"][3] = "hoses@2"
    with pytest.raises(InputError, match=r"hoses@2.*plug-ins"):
        restore_calibrated(contents, "arm.json")


def test_an_effect_without_a_formula_is_refused_before_anything_is_written(tmp_path):
    calibrated = make_calibrated("kuka")
    (*others, last) = calibrated.model.effects
    odd = replace(
        last, displacement=lambda around: [{0: np.arctan(around.joint_angles[:, 0])}]
    )
    effects = (*others, odd)
    calibrated = replace(calibrated, model=replace(calibrated.model, effects=effects))
    path = tmp_path / "arm.json"
    with pytest.raises(InputError, match="no formula"):
        write_made_model(path, calibrated)
    assert not path.exists()


def test_a_regression_without_a_formula_is_in_the_file_by_its_name(tmp_path):
    calibrated = make_calibrated("kuka")
    offset_m = calibrated.fit.estimate.target_offset[0]
    predictor = Predictor(lambda inputs: np.zeros((len(inputs), 3)))
    choice = make_choice("extra_trees")
    residual_model = ResidualModel(predictor, offset_m, 2e-5, 1.0, choice)
    model = describe_model(
        replace(calibrated, residual_model=residual_model), CAMPAIGNS["named"]
    )
    assert model.regression.name == "extra_trees" and model.regression.law is None
    write_model(tmp_path / "arm.json", model)
    assert read_model_file(tmp_path / "arm.json") == model


def test_formulas_of_a_file_are_those_of_its_effects(written):
    calibrated, path = written
    effects = read_model_file(path).effects
    assert [e.key for e in effects] == [e.key for e in calibrated.model.effects]
    (offset,) = [e for e in effects if e.key == "joint_offset@1"]
    ((_, unit, value),) = offset.parameters
    (term,) = offset.terms
    assert unit == "rad" and (term.coordinate, term.value) == (0, value)
    number = [e.key for e in effects].index("joint_offset@1")
    model = calibrated.model
    (formula,) = derive_formulas(
        model.effects[number], (), model.sites, model.nominal_compliance, "test"
    )
    assert [*formula] == [0]
