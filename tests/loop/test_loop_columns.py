"""Measurements and estimates to tables and back: what a later step reads is what an earlier one had."""

from dataclasses import replace

import numpy as np
import pytest
from made_folders import made_folder, made_table
from support import chain_of
from synthetic import NOISE, made_estimate, made_model

from elastocal.campaigns.campaign import Target
from elastocal.campaigns.columns import columns_of, measurements_from
from elastocal.campaigns.reading import read_campaign
from elastocal.effects.catalogue import candidates_on
from elastocal.fitting.case import case_from, noise_facts, noise_from
from elastocal.fitting.fit_result import Fit
from elastocal.fitting.least_squares import fit
from elastocal.fitting.noise import Noise
from elastocal.fitting.parameters import parameters
from elastocal.io.storage import TableSchema, read_table, write_table
from elastocal.loop.fit_columns import correlation_columns, estimate_from, parameter_columns
from elastocal.loop.loading import load_campaign
from elastocal.loop.schemas import CORRELATIONS, PARAMETER_COLUMNS, measurements

PARAMETERS = TableSchema("parameters", PARAMETER_COLUMNS)
COVARIATES = {
    "none": {},
    "all": {"approach3": [1.0, -1.0], "time_s": [0.0, 5.0], "temperature_c": [20.0, 21.5]},
}


def there_and_back(path, schema, columns):
    write_table(path, schema, [columns], {})
    return read_table(path, schema)


@pytest.mark.parametrize("measured", ["position", "pose"])
@pytest.mark.parametrize("covariates", COVARIATES)
def test_measurements_come_back_as_they_were(measured, covariates, kuka, config_folder, tmp_path):
    table = made_table(kuka, "c")
    count = len(table["pose"])
    table |= {name: np.resize(values, count) for name, values in COVARIATES[covariates].items()}
    table |= {f"approach{joint}": np.zeros(count) for joint in range(1, 7) if joint != 3 and covariates == "all"}
    table["session"] = table["pose"] % 2
    folder = made_folder(tmp_path / "c", kuka, table=table, measured=measured)
    before = read_campaign(folder, config_folder / "robots").measurements
    assert (before.rotation_vector is None) == (measured == "position")
    assert (before.approach is None) == (before.time_s is None) == (covariates == "none")
    after = measurements_from(there_and_back(tmp_path / "r.parquet", measurements(6), columns_of(before)))
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
    fitted = Fit(model, estimate, NOISE, held, covariance, np.ones(1), None, np.zeros((1, 3)), None, None)
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


def test_noise_comes_back_from_its_document():
    noise = Noise("repeats", 1e-5, 2e-5, np.array([1e-6, 0, 3e-6]), 77, 2e-6)
    back = noise_from({"noise": noise_facts(noise), "warnings": []})
    np.testing.assert_array_equal(back.joint_rad, noise.joint_rad)
    assert replace(back, joint_rad=None) == replace(noise, joint_rad=None)


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
