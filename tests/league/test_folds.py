"""The same folds for every method."""

import numpy as np
import pytest
from made_leagues import made_data_set

from elastocal.campaigns.campaign import measurements_from
from elastocal.io.json_files import write_json
from elastocal.io.storage import write_table
from elastocal.loop.schemas import measurements
from elastocal_proof.league.folds import BLOCKS, RANDOM, dealt, load_data_set, rounds
from elastocal_proof.league.schemas import FOLDS


def test_every_pose_is_held_out_once_and_folds_are_of_one_size(data):
    found = dealt(measurements_from(data.columns), 5, np.random.default_rng(2))
    assert len(found["pose"]) == 24
    for split in (RANDOM, BLOCKS):
        counts = np.bincount(found[split])
        assert counts[0] == 0 and len(counts) == 6 and np.ptp(counts[1:]) <= 1


def test_blocks_are_neighbours(data):
    """Two poses of one block are closer than two of different ones, on average."""
    seen = measurements_from(data.columns)
    first = np.unique(seen.pose, return_index=True)[1]
    angles, block = seen.joint_angles[first], data.dealt["blocks"]
    apart = np.linalg.norm(np.exp(1j * angles[:, None]) - np.exp(1j * angles), axis=2)
    same = block[:, None] == block
    assert apart[same & ~np.eye(24, dtype=bool)].mean() < 0.95 * apart[~same].mean()


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
    for _, training, (test,) in rounds(split, data):
        seen, unseen = (set(case.observations.states.pose) for case in (training, test))
        assert not seen & unseen and len(seen | unseen) == 24
        held += unseen
    assert sorted(held) == list(range(24))


def test_another_session_is_tested_as_a_whole_by_all_training_poses(data, kuka, config_folder, tmp_path):
    other = made_data_set(tmp_path, kuka, config_folder / "robots", poses=8, seed=3, name="other")
    ((fold, training, tests),) = rounds("session", data, [other])
    assert fold == 1 and len(training.observations.states) == 24
    assert [test.campaign.name for test in tests] == ["other"] and len(tests[0].observations.states) == 8
