"""What is kept of a fold comes back from its tables: entries, and diagnoses as the fits that they were."""

import numpy as np
import pytest
from made_folders import made_folder, made_table

from elastocal.diagnosis.diagnose import diagnose
from elastocal.diagnosis.settings import Settings
from elastocal.io.storage import read_table, write_table
from elastocal.loop.whole import cases_in
from elastocal_proof.league.fold_tables import entry_columns, fold_facts, fold_fits, mechanism_columns, physics_of_fold
from elastocal_proof.league.methods import DIAGNOSIS, GEOMETRY, Method, entered, fitted_physics
from elastocal_proof.league.rounds import held_out_rounds, training_rounds
from elastocal_proof.league.schemas import ENTRIES


def test_each_observation_has_its_pose_target_and_residual(data, tmp_path):
    _, training = next(training_rounds("blocks", data))
    fold, (held_out,) = next(held_out_rounds("blocks", data, []))
    entry = entered(Method(GEOMETRY), fitted_physics(GEOMETRY, training), training, held_out, "blocks", 1)
    path = tmp_path / "entries.parquet"
    write_table(path, ENTRIES, [entry_columns(entry, fold, 0)], {})
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
    facts, fits = {"2": fold_facts(found)}, {name: np.asarray(values) for name, values in fold_fits(found, 2).items()}
    again = physics_of_fold(Method(DIAGNOSIS), case, facts, fits, 2)
    assert [effect.key for effect in again.model.effects] == [effect.key for effect in found.final.model.effects]
    np.testing.assert_allclose(again.residual, found.final.residual, atol=2e-8)
    plain = physics_of_fold(Method(GEOMETRY), case, facts, fits, 2)
    assert len(plain.model.effects) < len(again.model.effects)


def test_mechanisms_have_their_probability_and_the_share_that_they_explain(diagnosed):
    _, found = diagnosed
    columns = mechanism_columns(found, 3)
    assert set(columns["fold"]) == {3} and columns["mechanism"][0] == "joint_offset"
    assert columns["probability"][0] > 0.99
    # One milliradian where the noise is 60 um: nearly all of the error.
    assert 0.7 < columns["share"][0] <= 1.0
    assert (np.asarray(columns["share"])[1:] < 0.1).all()
