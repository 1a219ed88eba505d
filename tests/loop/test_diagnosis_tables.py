"""Campaigns and estimates come back from their files as they were."""

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
from elastocal.loop.schemas import STEPS, build_measurements_schema

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


def test_a_case_is_the_folder_and_a_test_may_be_of_another_campaign(
    kuka, config_folder, tmp_path
):
    folder = make_folder(tmp_path / "made", kuka, declared=["joint_offset"])
    descriptions, training, _ = load_campaign(
        read_campaign_folder(folder, config_folder / "robots")
    )
    files = tmp_path / "descriptions.json", tmp_path / "training.parquet"
    other = {key: descriptions[key] for key in ("source", "campaign", "robot")}
    write_json(
        files[0],
        descriptions | {"held_out": changed(other, ("campaign", "campaign"), "other")},
    )
    write_table(
        files[1], build_measurements_schema(6), [tabulate_measurements(training)], {}
    )
    case = tables.load_case(*files)
    for name in ("pose", "load", "joint_angles", "wrench", "position"):
        np.testing.assert_array_equal(
            getattr(case.campaign.measurements, name), getattr(training, name)
        )
    assert (
        case.campaign.name == "made"
        and tables.load_case(*files, "held_out").campaign.name == "other"
    )
    assert case.campaign.noise == {"position_m": 6e-5} and [
        target.name for target in case.model.targets
    ] == ["3DoF", "6DoF"]
    assert "joint_offset" in {effect.effect for effect in case.model.effects}
    assert "joint_offset" not in {
        candidate.effect for candidate in case.candidates.values()
    }


@pytest.mark.parametrize("kind", MODELS)
def test_models_and_estimates_come_back_from_json_and_parameters_from_their_table(
    kind, tmp_path
):
    settings, keys = MODELS[kind]
    chain = chain_of(
        "Tz(0.4) Rz(q1) Tx(0.1) Ry(q2) Tx(0.7) [elbow] Ry(q3) Tx(0.6) [hand]"
    )
    declared = make_model(
        chain, TARGETS if settings["fitted_frames"] else TARGETS[:1], **settings
    )
    candidates = candidates_on(declared.sites)
    # A prior whose size was estimated.
    sized = [
        replace(
            each,
            parameters=tuple(
                replace(p, prior_std=1.5e-3, sized=True) for p in each.parameters
            ),
        )
        for each in (candidates[key] for key in keys)
    ]
    model = declared.with_effects(sized)
    estimate = make_estimate(
        model, sessions=(0, 7) if settings["fitted_frames"] else (3,), seed=1
    )
    listed = list_parameters(model, estimate)
    held = np.arange(len(listed)) % 3 == 1
    covariance = np.diag(1.0 - held)
    fitted = Fit(
        model,
        estimate,
        NOISE,
        held,
        covariance,
        np.ones(1),
        None,
        np.zeros((1, 3)),
        None,
        None,
    )
    found = SimpleNamespace(document={}, steps=[Step("all", "effect", fitted)])
    (step,) = json.loads(json.dumps(tables.serialize_diagnosis(found)))["steps"]
    again, back = tables.restore_step_model(
        SimpleNamespace(model=declared, candidates=candidates), step
    )
    assert again.effects == model.effects and back.sessions == estimate.sessions
    for name in (
        "frame_rotation",
        "frame_position",
        "target_offset",
        "target_rotation",
    ):
        np.testing.assert_array_equal(
            getattr(back, name), getattr(estimate, name), err_msg=name
        )
    for name in ("coefficients", "shapes"):
        for one, other in zip(
            getattr(back, name), getattr(estimate, name), strict=True
        ):
            np.testing.assert_array_equal(one, other)
    write_table(tmp_path / "p.parquet", STEPS, tables.generate_step_blocks(found), {})
    columns = tables.select_final_parameters(
        {"steps": [step]}, read_table(tmp_path / "p.parquet", STEPS)
    )
    assert columns["held"].tolist() == held.tolist()
    assert columns["unit"].tolist() == [parameter.unit for _, parameter in listed]
    priors = [parameter.prior_std for _, parameter in listed]
    np.testing.assert_array_equal(
        columns["prior_std"], [np.nan if prior is None else prior for prior in priors]
    )
    shown = {
        (o, p): v
        for o, p, v in zip(
            columns["owner"], columns["parameter"], columns["value"], strict=True
        )
    }
    for session, shift in zip(
        estimate.sessions if settings["fitted_frames"] else (),
        estimate.frame_position,
        strict=False,
    ):
        assert [
            shown[f"frame {session}", name] for name in ("dx", "dy", "dz")
        ] == shift.tolist()
    for effect, values in zip(model.effects, estimate.coefficients, strict=True):
        assert [shown[effect.key, p.name] for p in effect.parameters] == values.tolist()
