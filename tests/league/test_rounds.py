"""A data set comes back from its files; training and held-out poses of each fold never share a pose."""

import numpy as np
import pytest
from made_leagues import made_data_set

from elastocal.io.json_files import write_json
from elastocal.io.storage import write_table
from elastocal.loop.schemas import measurements
from elastocal_proof.league.rounds import held_out_rounds, load_data_set, training_rounds
from elastocal_proof.league.schemas import FOLDS


def test_descriptions_measurements_and_folds_come_back(data, tmp_path):
    write_json(tmp_path / "campaign.json", data.descriptions)
    write_table(tmp_path / "seen.parquet", measurements(6), [data.columns], {})
    write_table(tmp_path / "folds.parquet", FOLDS, [data.dealt], {})
    found = load_data_set(tmp_path / "campaign.json", tmp_path / "seen.parquet", tmp_path / "folds.parquet")
    assert found.descriptions["campaign"] == data.descriptions["campaign"]
    for name, values in data.columns.items():
        np.testing.assert_array_equal(found.columns[name], values)
    np.testing.assert_array_equal(found.dealt["blocks"], data.dealt["blocks"])
    assert len(found.case().observations.states) == 24


@pytest.mark.parametrize("split", ["random", "blocks"])
def test_the_poses_of_a_fold_are_either_trained_on_or_held_out(data, split):
    held = []
    rounds = zip(training_rounds(split, data), held_out_rounds(split, data, []), strict=True)
    for (fold, training), (same, tests) in rounds:
        (test,) = tests
        seen, unseen = (set(case.observations.states.pose) for case in (training, test))
        assert fold == same and not seen & unseen and len(seen | unseen) == 24
        held += unseen
    assert sorted(held) == list(range(24))


def test_another_session_is_tested_as_a_whole_by_all_training_poses(data, kuka, config_folder, tmp_path):
    other = made_data_set(tmp_path, kuka, config_folder / "robots", poses=8, seed=3, name="other")
    ((fold, training),) = training_rounds("session", data)
    ((same, tests),) = held_out_rounds("session", data, [other])
    assert fold == same == 1 and len(training.observations.states) == 24
    assert [test.campaign.name for test in tests] == ["other"] and len(tests[0].observations.states) == 8
