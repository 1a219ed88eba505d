"""Training and held-out poses of each fold never share a pose."""

import pytest
from made_leagues import made_data_set

from elastocal_proof.league.rounds import held_out_rounds, training_rounds


@pytest.fixture(scope="module")
def data(kuka, config_folder, tmp_path_factory):
    return made_data_set(tmp_path_factory.mktemp("rounds"), kuka, config_folder / "robots")


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
