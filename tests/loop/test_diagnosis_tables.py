"""Campaigns, estimates and covariances come back from their files as they were."""

import numpy as np
import pytest
from made_folders import made_folder
from support import chain_of, changed
from synthetic import NOISE, made_estimate, made_model

from elastocal.campaigns.campaign import Target
from elastocal.campaigns.columns import columns_of
from elastocal.effects.catalogue import candidates_on
from elastocal.fitting.least_squares import Fit
from elastocal.fitting.model import parameters
from elastocal.io.json_files import write_json
from elastocal.io.storage import TableSchema, read_table, write_table
from elastocal.loop import diagnosis_tables as tables
from elastocal.loop.loading import load_campaign
from elastocal.loop.schemas import CORRELATIONS, PARAMETER_COLUMNS, measurements

PARAMETERS = TableSchema("parameters", PARAMETER_COLUMNS)
MODELS = {
    "frames, targets, springs": (dict(fitted_frames=True, rows=6, identified=True), ()),
    "positions": (dict(fitted_frames=True, rows=3, identified=True), ("joint_offset@1",)),
    "nothing but effects": (dict(fitted_frames=False, rows=3), ("lost_motion@2", "frame_drift", "stiffening@1")),
    "nothing": (dict(fitted_frames=False, rows=3), ()),
}
TARGETS = (
    Target("known", "elbow", (0.1, 0.0, -0.2), (0.5, 0.0, -1.0)),
    Target("A", "hand", None),
    Target("b c", "elbow", None),
    Target("mount", "elbow", (0.1, 0.0, 0.2), None),
    Target("placed", "elbow", None, (0.1, 1.0, 0.0)),
)


@pytest.fixture(scope="module")
def loaded(kuka, config_folder, tmp_path_factory):
    """Descriptions and training measurements of a campaign that declares an effect."""
    folder = made_folder(tmp_path_factory.mktemp("loop") / "made", kuka, declared=["joint_offset"])
    return load_campaign(folder, config_folder / "robots")[:2]


@pytest.fixture
def files(loaded, tmp_path):
    descriptions, training = loaded
    paths = tmp_path / "descriptions.json", tmp_path / "training.parquet"
    write_json(paths[0], descriptions)
    write_table(paths[1], measurements(6), [columns_of(training)], {})
    return paths


def test_a_case_has_the_measurements_and_the_description_of_the_folder_and_looks_for_nothing_declared(files, loaded):
    case, training = tables.load_case(*files), loaded[1]
    for name in ("pose", "load", "joint_angles", "wrench", "position"):
        np.testing.assert_array_equal(getattr(case.campaign.measurements, name), getattr(training, name))
    assert case.campaign.name == "made" and case.campaign.noise == {"position_m": 6e-5}
    assert [target.name for target in case.model.targets] == ["3DoF", "6DoF"]
    assert {effect.effect for effect in case.model.effects} >= {"joint_offset"}
    assert "joint_offset" not in {candidate.effect for candidate in case.candidates.values()}


def test_a_test_has_the_description_of_another_campaign_where_it_is_one(files, loaded):
    descriptions = loaded[0]
    assert tables.load_case(*files, "held_out").campaign.name == "made"
    other = {key: descriptions[key] for key in ("source", "campaign", "robot")}
    write_json(files[0], descriptions | {"held_out": changed(other, ("campaign", "campaign"), "other")})
    assert [tables.load_case(*files, part).campaign.name for part in (None, "held_out")] == ["made", "other"]


def there_and_back(path, schema, columns):
    write_table(path, schema, [columns], {})
    return read_table(path, schema)


@pytest.mark.parametrize("kind", MODELS)
def test_estimates_and_covariances_come_back_from_their_tables(kind, tmp_path):
    settings, keys = MODELS[kind]
    chain = chain_of("Tz(0.4) Rz(q1) Tx(0.1) Ry(q2) Tx(0.7) [elbow] Ry(q3) Tx(0.6) [hand]")
    model = made_model(chain, TARGETS if settings["fitted_frames"] else TARGETS[:1], **settings)
    model = model.with_effects([candidates_on(model.sites)[key] for key in keys])
    estimate = made_estimate(model, sessions=(0, 7) if settings["fitted_frames"] else (3,), seed=1)
    listed = parameters(model, estimate)
    root = np.random.default_rng(2).standard_normal((len(listed), len(listed)))
    held = np.arange(len(listed)) % 3 == 1
    covariance = root @ root.T * np.outer(~held, ~held)
    fitted = Fit(model, estimate, NOISE, held, covariance, np.ones(1), None, np.zeros((1, 3)), None, None)
    columns = there_and_back(tmp_path / "p.parquet", PARAMETERS, tables.parameter_columns(fitted))
    pairs = there_and_back(tmp_path / "c.parquet", CORRELATIONS, tables.correlation_columns(fitted))
    back = tables.estimate_from(columns, model, estimate.sessions)
    assert back.sessions == estimate.sessions
    for name in ("frame_rotation", "frame_position", "target_offset", "target_rotation"):
        np.testing.assert_allclose(getattr(back, name), getattr(estimate, name), atol=1e-14, err_msg=name)
    for name in ("coefficients", "shapes"):
        for one, other in zip(getattr(back, name), getattr(estimate, name), strict=True):
            np.testing.assert_array_equal(one, other)
    assert columns["held"].tolist() == held.tolist()
    assert columns["unit"].tolist() == [parameter.unit for _, parameter in listed]
    priors = [parameter.prior_std for _, parameter in listed]
    np.testing.assert_array_equal(columns["prior_std"], [np.nan if prior is None else prior for prior in priors])
    # What is held is in no pair, and every other pair is there once.
    assert len(pairs["one"]) == (~held).sum() * ((~held).sum() - 1) // 2 and (np.abs(pairs["correlation"]) <= 1).all()
    np.testing.assert_allclose(tables.covariance_from(columns, pairs), covariance, rtol=1e-12, atol=1e-15)
