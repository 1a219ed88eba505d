"""Estimates to tables and back, and the correlations of what was estimated."""

import numpy as np
import pytest
from made_folders import made_folder, made_table
from support import chain_of
from synthetic import NOISE, made_estimate, made_model

from elastocal.campaigns.campaign import Target
from elastocal.campaigns.columns import columns_of
from elastocal.effects.catalogue import candidates_on
from elastocal.fitting.case import case_from
from elastocal.fitting.fit_result import Fit
from elastocal.fitting.least_squares import fit
from elastocal.fitting.noise import Noise
from elastocal.fitting.parameters import parameters
from elastocal.io.storage import TableSchema, read_table, write_table
from elastocal.loop.fit_columns import correlation_columns, covariance_from, estimate_from, parameter_columns
from elastocal.loop.loading import load_campaign
from elastocal.loop.schemas import CORRELATIONS, PARAMETER_COLUMNS

PARAMETERS = TableSchema("parameters", PARAMETER_COLUMNS)
MODELS = {
    "frames, targets, springs": (dict(fitted_frames=True, rows=6, identified=True), ()),
    "positions": (dict(fitted_frames=True, rows=3, identified=True), ("joint_offset@1",)),
    "nothing but effects": (dict(fitted_frames=False, rows=3), ("lost_motion@2", "frame_drift", "stiffening@1")),
    "nothing": (dict(fitted_frames=False, rows=3), ()),
}
TARGET_ON_HAND = (Target("known", "hand", (0.1, 0.0, -0.2)),)
TARGETS = (
    Target("A", "hand", None),
    Target("known", "elbow", (0.1, 0.0, -0.2), (0.5, 0.0, -1.0)),
    Target("b c", "elbow", None),
    Target("mount", "elbow", (0.1, 0.0, 0.2), None),
    Target("placed", "elbow", None, (0.1, 1.0, 0.0)),
)


def fit_of(model, estimate, held, covariance):
    return Fit(model, estimate, NOISE, held, covariance, np.ones(1), None, np.zeros((1, 3)), None, None)


def there_and_back(path, schema, columns):
    write_table(path, schema, [columns], {})
    return read_table(path, schema)


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
    fitted = fit_of(model, estimate, held, covariance)
    columns = there_and_back(tmp_path / "p.parquet", PARAMETERS, parameter_columns(fitted))
    back = estimate_from(columns, model, estimate.sessions)
    assert back.sessions == estimate.sessions
    for name in ("frame_rotation", "frame_position", "target_offset", "target_rotation"):
        np.testing.assert_allclose(getattr(back, name), getattr(estimate, name), atol=1e-14, err_msg=name)
    for name in ("coefficients", "shapes"):
        for one, other in zip(getattr(back, name), getattr(estimate, name), strict=True):
            np.testing.assert_array_equal(one, other)
    assert columns["held"].tolist() == held.tolist()
    np.testing.assert_allclose(columns["std_error"], np.sqrt(np.diag(covariance)))
    priors = [parameter.prior_std for _, parameter in parameters(model, estimate)]
    np.testing.assert_array_equal(columns["prior_std"], [np.nan if prior is None else prior for prior in priors])


@pytest.fixture(scope="module")
def declared(kuka, config_folder, tmp_path_factory):
    """The declared model fitted to a campaign."""
    folder = tmp_path_factory.mktemp("loop") / "made"
    made_folder(folder, kuka, table=made_table(kuka, "made"), frame="tracker", measured="pose")
    descriptions, training, _ = load_campaign(folder, config_folder / "robots")
    case = case_from(descriptions, columns_of(training))
    return fit(case.model, case.observations, Noise("declared", 6e-5, 6e-5, np.zeros(6)))


def test_correlations_are_of_every_pair_that_is_not_held(declared, tmp_path):
    table = there_and_back(tmp_path / "c.parquet", CORRELATIONS, correlation_columns(declared))
    free = int((~declared.held).sum())
    assert len(table["one"]) == free * (free - 1) // 2
    assert (np.abs(table["correlation"]) <= 1).all()
    names = [f"{owner} {parameter.name}" for owner, parameter in declared.parameters]
    for one, other, value in list(zip(table["one"], table["other"], table["correlation"], strict=True))[::50]:
        i, j = names.index(one), names.index(other)
        expected = declared.covariance[i, j] / np.sqrt(declared.covariance[i, i] * declared.covariance[j, j])
        assert value == pytest.approx(expected)


def made_fit(held, covariance):
    """A fit of two gears that have play, with a given covariance."""
    model = made_model(chain_of("Rz(q1) Tx(1) Ry(q2) Tx(0.5) [hand]"), TARGET_ON_HAND, rows=3, fitted_frames=False)
    model = model.with_effects([candidates_on(model.sites)[f"joint_offset@{joint}"] for joint in (1, 2)])
    return fit_of(model, made_estimate(model), np.array(held), np.array(covariance))


def test_a_parameter_that_is_held_is_in_no_pair_and_has_no_error():
    fitted = made_fit([False, True], [[4e-8, 0.0], [0.0, 0.0]])
    assert not len(correlation_columns(fitted)["correlation"])
    columns = parameter_columns(fitted)
    assert columns["held"].tolist() == [False, True]
    np.testing.assert_allclose(columns["std_error"], [2e-4, 0.0])


def test_a_target_at_a_known_place_keeps_that_place_and_is_in_no_table():
    fitted = made_fit([False, False], np.eye(2))
    columns = parameter_columns(fitted)
    assert set(columns["owner"]) == {"joint_offset@1", "joint_offset@2"} and set(columns["unit"]) == {"rad"}
    back = estimate_from(columns, fitted.model, (3,))
    np.testing.assert_array_equal(back.target_offset, [[0.1, 0.0, -0.2]])
    np.testing.assert_array_equal(back.frame_rotation, [np.eye(3)])
    assert back.sessions == (3,) and not back.frame_position.any()


def test_the_covariance_comes_back_from_both_tables(tmp_path):
    chain = chain_of("Tz(0.4) Rz(q1) Tx(0.7) [elbow] Ry(q2) Tx(0.6) [hand]")
    model = made_model(chain, TARGET_ON_HAND, rows=3, identified=True)
    model = model.with_effects([candidates_on(model.sites)["joint_offset@1"]])
    estimate = made_estimate(model, sessions=(0,), seed=1)
    count = len(parameters(model, estimate))
    root = np.random.default_rng(2).standard_normal((count, count))
    held = np.arange(count) == 1
    covariance = root @ root.T * np.outer(~held, ~held)
    fitted = fit_of(model, estimate, held, covariance)
    tables = (
        there_and_back(tmp_path / "p.parquet", PARAMETERS, parameter_columns(fitted)),
        there_and_back(tmp_path / "c.parquet", CORRELATIONS, correlation_columns(fitted)),
    )
    np.testing.assert_allclose(covariance_from(*tables), covariance, rtol=1e-12, atol=1e-15)
