"""Entries come back from their table."""

import numpy as np
from made_leagues import made_data_set

from elastocal.io.storage import read_table, write_table
from elastocal_proof.league.entry_columns import entry_columns
from elastocal_proof.league.methods import GEOMETRY, Method, entered, fitted_physics
from elastocal_proof.league.rounds import held_out_rounds, training_rounds
from elastocal_proof.league.schemas import ENTRIES


def test_each_observation_has_its_pose_target_and_residual(kuka, config_folder, tmp_path):
    data = made_data_set(tmp_path / "made", kuka, config_folder / "robots")
    _, training = next(training_rounds("blocks", data))
    fold, (held_out,) = next(held_out_rounds("blocks", data, []))
    entry = entered(Method(GEOMETRY), fitted_physics(GEOMETRY, training), training, held_out, "blocks", 1)
    path = tmp_path / "entries.parquet"
    write_table(path, ENTRIES, [entry_columns(entry, fold, 0)], {})
    found = read_table(path, ENTRIES)
    np.testing.assert_array_equal(np.column_stack([found[f"d{axis}"] for axis in "xyz"]), entry.residual)
    assert set(found["pose"]) == set(data.dealt["pose"][data.dealt["blocks"] == fold]) and set(found["fold"]) == {fold}
    assert np.isnan(found["std_x"]).all()
