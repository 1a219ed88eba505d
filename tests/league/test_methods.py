"""What a method is, and what it predicts of poses that it has not seen."""

import numpy as np
import pytest
from made_folders import made_folder, made_table
from made_leagues import made_data_set

from elastocal.diagnosis.diagnose import diagnose
from elastocal.diagnosis.settings import Settings
from elastocal.errors import InputError
from elastocal.io.storage import read_table, write_table
from elastocal.loop.whole import cases_in
from elastocal_proof.league.folds import rounds
from elastocal_proof.league.methods import (
    FRAMES,
    GEOMETRY,
    Method,
    entered,
    fit_of_fold,
    fitted_physics,
    fold_tables,
    mechanism_columns,
    method_from,
)
from elastocal_proof.league.schemas import ENTRIES


@pytest.fixture(scope="module")
def fold(kuka, config_folder, tmp_path_factory):
    data = made_data_set(tmp_path_factory.mktemp("methods"), kuka, config_folder / "robots", poses=60)
    _, training, (held_out,) = next(rounds("random", data))
    return training, held_out


def rms(entry):
    return np.sqrt((entry.residual**2).sum(axis=1).mean())


def test_frames_alone_have_no_parameters_of_the_robot_and_geometry_has(fold):
    training, _ = fold
    owners = [{owner for owner, _ in fitted_physics(physics, training).parameters} for physics in (FRAMES, GEOMETRY)]
    assert all(owner.startswith(("frame ", "target ")) for owner in owners[0])
    assert {owner.partition("@")[0] for owner in owners[1] - owners[0]} == {"joint_offset"}


def test_a_regression_lowers_what_geometry_leaves_of_something_smooth(fold):
    training, held_out = fold
    fitted = fitted_physics(GEOMETRY, training)
    alone, process = (
        entered(Method(GEOMETRY, name), fitted, training, held_out, "random", 1) for name in (None, "gaussian_process")
    )
    assert rms(process) < 0.8 * rms(alone)
    assert np.isfinite(process.std).all()


def test_a_regression_that_is_not_there_is_refused_in_one_line():
    with pytest.raises(InputError, match=r"league\.methods\.mine\.regression.*'magic'.*gaussian_process"):
        method_from({"physics": "geometry", "regression": "magic", "words": ""}, "mine", "config.yaml")
    assert method_from({"physics": "frames", "words": "frames only"}, "mine", "config.yaml").words == "frames only"


def test_each_observation_has_its_pose_target_and_residual(data, tmp_path):
    fold, training, (held_out,) = next(rounds("blocks", data))
    entry = entered(Method(GEOMETRY), fitted_physics(GEOMETRY, training), training, held_out, "blocks", 1)
    path = tmp_path / "entries.parquet"
    write_table(path, ENTRIES, [entry.columns(fold, 0)], {})
    found = read_table(path, ENTRIES)
    np.testing.assert_array_equal(np.column_stack([found[f"d{axis}"] for axis in "xyz"]), entry.residual)
    assert set(found["pose"]) == set(data.dealt["pose"][data.dealt["blocks"] == fold]) and set(found["fold"]) == {fold}
    assert np.isnan(found["std_x"]).all()


@pytest.fixture(scope="module")
def diagnosed(kuka, config_folder, tmp_path_factory):
    folder = tmp_path_factory.mktemp("diagnosed") / "made"
    made_folder(folder, kuka, table=made_table(kuka, "made", offset_of_joint_3=1e-3))
    case, _ = cases_in(folder, config_folder / "robots")
    return case, diagnose(case, Settings(), 1)


def test_the_fit_of_a_fold_is_that_which_its_diagnosis_left(diagnosed):
    case, found = diagnosed
    facts, _ = fold_tables(found, 2)
    again = fit_of_fold(case, {"2": facts}, 2)
    assert [effect.key for effect in again.model.effects] == [effect.key for effect in found.final.model.effects]
    np.testing.assert_allclose(again.residual, found.final.residual, atol=2e-8)
    plain = fitted_physics(GEOMETRY, case)
    assert len(plain.model.effects) < len(again.model.effects)


def test_mechanisms_have_their_probability_and_the_share_that_they_explain(diagnosed):
    _, found = diagnosed
    columns = mechanism_columns(found, 3)
    assert set(columns["fold"]) == {3} and columns["mechanism"][0] == "joint_offset"
    assert columns["probability"][0] > 0.99
    # One milliradian where the noise is 60 um: nearly all of the error.
    assert 0.7 < columns["share"][0] <= 1.0
    assert (np.asarray(columns["share"])[1:] < 0.1).all()
