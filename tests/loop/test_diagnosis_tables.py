"""A diagnosis is restored from its files as it was."""

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from made_folders import make_folder
from support import chain_of, changed
from synthetic import NOISE, make_estimate, make_model

from elastocal.campaigns.campaign import Target, tabulate_measurements
from elastocal.campaigns.campaign_folder import read_campaign_folder
from elastocal.diagnosis.diagnose import Step
from elastocal.effects.catalogue import candidates_on
from elastocal.fitting.least_squares import Fit
from elastocal.fitting.model import list_parameters
from elastocal.io.json_files import write_json
from elastocal.io.storage import read_table, write_table
from elastocal.loop import diagnosis_tables as tables
from elastocal.loop.loading import load_campaign
from elastocal.loop.schemas import MEASUREMENTS, STEPS

MODELS = {
    "frames, targets, springs": (dict(fitted_frames=True, rows=6, identified=True), ()),
    "positions": (
        dict(fitted_frames=True, rows=3, identified=True),
        ("joint_offset@1",),
    ),
    "nothing but effects": (
        dict(fitted_frames=False, rows=3),
        ("lost_motion@2", "frame_drift", "stiffening@1"),
    ),
    "nothing": (dict(fitted_frames=False, rows=3), ()),
}
TARGETS = (
    Target("known", "elbow", (0.1, 0.0, -0.2), (0.5, 0.0, -1.0)),
    Target("A", "hand", None),
    Target("b c", "elbow", None),
    Target("mount", "elbow", (0.1, 0.0, 0.2), None),
    Target("placed", "elbow", None, (0.1, 1.0, 0.0)),
)


def test_a_case_is_restored_and_may_be_validated_by_another_campaign(
    kuka, config_folder, tmp_path
):
    folder = make_folder(tmp_path / "made", kuka, declared=["joint_offset"])
    descriptions, training, _ = load_campaign(
        read_campaign_folder(folder, config_folder / "robots")
    )
    documents = {key: descriptions[key] for key in ("source", "campaign", "robot")}
    validating = changed(documents, ("campaign", "campaign"), "validating")
    files = (tmp_path / "descriptions.json", tmp_path / "training.parquet")
    write_json(files[0], descriptions | {"held_out": validating})
    write_table(
        files[1], MEASUREMENTS.for_joints(6), [tabulate_measurements(training)], {}
    )
    case = tables.load_case(*files)
    for name in ("pose", "load", "joint_angles", "wrench", "position"):
        restored = getattr(case.campaign.measurements, name)
        np.testing.assert_array_equal(restored, getattr(training, name))
    assert case.campaign.name == "made"
    assert tables.load_case(*files, "held_out").campaign.name == "validating"
    assert case.campaign.noise == {"position_m": 6e-5}
    assert [target.name for target in case.model.targets] == ["3DoF", "6DoF"]
    candidates = {candidate.effect for candidate in case.candidates.values()}
    assert "joint_offset" in {effect.effect for effect in case.model.effects}
    assert "joint_offset" not in candidates


@pytest.fixture(params=MODELS)
def stored(request):
    """A declared model with its candidates, and a diagnosis of one step.

    The diagnosis has effects whose prior sizes were estimated.
    """
    settings, keys = MODELS[request.param]
    chain = chain_of(
        "Tz(0.4) Rz(q1) Tx(0.1) Ry(q2) Tx(0.7) [elbow] Ry(q3) Tx(0.6) [hand]"
    )
    has_frames = settings["fitted_frames"]
    declared = make_model(chain, TARGETS if has_frames else TARGETS[:1], **settings)
    case = SimpleNamespace(model=declared, candidates=candidates_on(declared.sites))
    effects = [_estimate_sizes(case.candidates[key]) for key in keys]
    model = declared.with_effects(effects)
    estimate = make_estimate(model, sessions=(0, 7) if has_frames else (3,), seed=1)
    held = np.arange(len(list_parameters(model, estimate))) % 3 == 1
    fitted = Fit(
        model,
        estimate,
        NOISE,
        held,
        np.diag(1.0 - held),
        np.ones(1),
        None,
        np.zeros((1, 3)),
        None,
        None,
    )
    diagnosis = SimpleNamespace(document={}, steps=[Step("all", "effect", fitted)])
    return case, diagnosis


def _estimate_sizes(candidate):
    parameters = tuple(
        replace(parameter, prior_std=1.5e-3, sized=True)
        for parameter in candidate.parameters
    )
    return replace(candidate, parameters=parameters)


def test_models_and_estimates_survive_diagnosis_json(stored):
    case, diagnosis = stored
    fitted = diagnosis.steps[0].fitted
    document = json.loads(json.dumps(tables.serialize_diagnosis(diagnosis)))
    model, estimate = tables.restore_step_model(case, document["steps"][0])
    assert model.effects == fitted.model.effects
    assert estimate.sessions == fitted.estimate.sessions
    for name in (
        "frame_rotation",
        "frame_position",
        "target_offset",
        "target_rotation",
    ):
        np.testing.assert_array_equal(
            getattr(estimate, name), getattr(fitted.estimate, name), err_msg=name
        )
    for name in ("coefficients", "shapes"):
        expected = getattr(fitted.estimate, name)
        for values, expected_values in zip(
            getattr(estimate, name), expected, strict=True
        ):
            np.testing.assert_array_equal(values, expected_values)


def test_parameters_survive_the_steps_table(stored, tmp_path):
    _, diagnosis = stored
    fitted = diagnosis.steps[0].fitted
    estimate = fitted.estimate
    parameters = [parameter for _, parameter in list_parameters(fitted.model, estimate)]
    path = tmp_path / "steps.parquet"
    write_table(path, STEPS, tables.generate_step_blocks(diagnosis), {})
    columns = tables.select_final_parameters(
        tables.serialize_diagnosis(diagnosis), read_table(path, STEPS)
    )
    assert columns["held"].tolist() == fitted.unidentifiable.tolist()
    assert columns["unit"].tolist() == [parameter.unit for parameter in parameters]
    priors = [parameter.prior_std for parameter in parameters]
    np.testing.assert_array_equal(
        columns["prior_std"], [np.nan if prior is None else prior for prior in priors]
    )
    names = zip(columns["owner"], columns["parameter"], strict=True)
    values = dict(zip(names, columns["value"], strict=True))
    frames = estimate.sessions if fitted.model.fitted_frames else ()
    for session, position in zip(frames, estimate.frame_position, strict=False):
        owner = f"frame {session}"
        restored = [values[owner, name] for name in ("dx", "dy", "dz")]
        assert restored == position.tolist()
    for effect, coefficients in zip(
        fitted.model.effects, estimate.coefficients, strict=True
    ):
        restored = [values[effect.key, entry.name] for entry in effect.parameters]
        assert restored == coefficients.tolist()
