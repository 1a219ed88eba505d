"""A data set comes back from the files that dealt it out."""

import numpy as np
from made_leagues import made_data_set

from elastocal.io.json_files import write_json
from elastocal.io.storage import write_table
from elastocal.loop.schemas import measurements
from elastocal_proof.league.data_files import load_data_set
from elastocal_proof.league.schemas import FOLDS


def test_descriptions_measurements_and_folds_come_back(kuka, config_folder, tmp_path):
    data = made_data_set(tmp_path / "made", kuka, config_folder / "robots")
    write_json(tmp_path / "campaign.json", data.descriptions)
    write_table(tmp_path / "seen.parquet", measurements(6), [data.columns], {})
    write_table(tmp_path / "folds.parquet", FOLDS, [data.dealt], {})
    found = load_data_set(tmp_path / "campaign.json", tmp_path / "seen.parquet", tmp_path / "folds.parquet")
    assert found.descriptions["campaign"] == data.descriptions["campaign"]
    for name, values in data.columns.items():
        np.testing.assert_array_equal(found.columns[name], values)
    np.testing.assert_array_equal(found.dealt["blocks"], data.dealt["blocks"])
    assert len(found.case().observations.states) == 24
