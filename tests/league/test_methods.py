"""The same folds for every method, and what a method predicts of poses that it has not
seen."""

import numpy as np
import pytest
from made_folders import make_folder, make_table
from made_leagues import make_data_set

from elastocal.campaigns.campaign import build_measurements
from elastocal.diagnosis.diagnose import diagnose
from elastocal.diagnosis.settings import Settings
from elastocal.errors import InputError
from elastocal.io.json_files import write_json
from elastocal.io.storage import read_table, write_table
from elastocal.loop.diagnosis_tables import refit_step, serialize_diagnosis
from elastocal.loop.schemas import build_measurements_schema
from elastocal.loop.whole import read_cases
from elastocal_proof.league.methods import (
    FRAMES,
    GEOMETRY,
    Method,
    deal_folds,
    fit_physics,
    load_data_set,
    parse_method,
    predict_held_out,
    split_rounds,
    tabulate_mechanisms,
)
from elastocal_proof.league.schemas import ENTRIES, FOLDS


@pytest.fixture(scope="module")
def data(kuka, config_folder, tmp_path_factory):
    return make_data_set(
        tmp_path_factory.mktemp("data_set"), kuka, config_folder / "robots"
    )


def test_every_pose_is_held_out_once_in_folds_of_one_size_and_blocks_are_neighbours(
    data,
):
    found = deal_folds(build_measurements(data.columns), 5, np.random.default_rng(2))
    assert len(found["pose"]) == 24
    for split in ("random", "blocks"):
        counts = np.bincount(found[split])
        assert counts[0] == 0 and len(counts) == 6 and np.ptp(counts[1:]) <= 1
    seen = build_measurements(data.columns)
    angles = seen.joint_angles[np.unique(seen.pose, return_index=True)[1]]
    block = data.folds["blocks"]
    apart = np.linalg.norm(np.exp(1j * angles[:, None]) - np.exp(1j * angles), axis=2)
    same = block[:, None] == block
    assert apart[same & ~np.eye(24, dtype=bool)].mean() < 0.95 * apart[~same].mean()


def test_a_data_set_comes_back_from_its_files(data, tmp_path):
    write_json(tmp_path / "campaign.json", data.descriptions)
    write_table(
        tmp_path / "seen.parquet", build_measurements_schema(6), [data.columns], {}
    )
    write_table(tmp_path / "folds.parquet", FOLDS, [data.folds], {})
    found = load_data_set(
        tmp_path / "campaign.json",
        tmp_path / "seen.parquet",
        tmp_path / "folds.parquet",
    )
    for mine, read in ((data.columns, found.columns), (data.folds, found.folds)):
        for name, values in mine.items():
            np.testing.assert_array_equal(read[name], values)
    assert len(found.build_case().observations.states) == 24


@pytest.mark.parametrize("split", ["random", "blocks"])
def test_the_poses_of_a_fold_are_either_trained_on_or_held_out(data, split):
    held = []
    for _, training, (test,) in split_rounds(split, data):
        seen, unseen = (set(case.observations.states.pose) for case in (training, test))
        assert not seen & unseen and len(seen | unseen) == 24
        held += unseen
    assert sorted(held) == list(range(24))


def test_another_session_is_tested_as_a_whole_by_all_training_poses(
    data, kuka, config_folder, tmp_path
):
    other = make_data_set(
        tmp_path, kuka, config_folder / "robots", poses=8, seed=3, name="other"
    )
    ((fold, training, tests),) = split_rounds("session", data, [other])
    assert fold == 1 and len(training.observations.states) == 24
    assert [test.campaign.name for test in tests] == ["other"] and len(
        tests[0].observations.states
    ) == 8


def residual(columns):
    return np.column_stack([columns[f"d{axis}"] for axis in "xyz"])


def test_frames_alone_have_no_parameters_of_the_robot_and_a_regression_lowers_what_geometry_leaves(
    kuka, config_folder, tmp_path
):
    many = make_data_set(tmp_path, kuka, config_folder / "robots", poses=60)
    _, training, (held_out,) = next(split_rounds("random", many))
    frames, geometry = (
        fit_physics(physics, training) for physics in (FRAMES, GEOMETRY)
    )
    owners = [
        {owner for owner, _ in fitted.parameters} for fitted in (frames, geometry)
    ]
    assert all(owner.startswith(("frame ", "target ")) for owner in owners[0])
    assert {owner.partition("@")[0] for owner in owners[1] - owners[0]} == {
        "joint_offset"
    }
    alone, process = (
        predict_held_out(
            Method(GEOMETRY, name), geometry, training, held_out, "random", 1
        )
        for name in (None, "gaussian_process")
    )
    assert (residual(process) ** 2).sum() < 0.64 * (residual(alone) ** 2).sum()
    assert np.isfinite(process["std_x"]).all() and np.isnan(alone["std_x"]).all()


def test_a_regression_that_is_not_there_is_refused_in_one_line():
    with pytest.raises(
        InputError,
        match=r"league\.methods\.mine\.regression.*'magic'.*gaussian_process",
    ):
        parse_method(
            {"physics": "geometry", "regression": "magic", "words": ""},
            "mine",
            "config.yaml",
        )
    assert (
        parse_method(
            {"physics": "frames", "words": "frames only"}, "mine", "config.yaml"
        ).words
        == "frames only"
    )


def test_each_observation_has_its_pose_target_and_residual(data, tmp_path):
    fold, training, (held_out,) = next(split_rounds("blocks", data))
    columns = predict_held_out(
        Method(GEOMETRY),
        fit_physics(GEOMETRY, training),
        training,
        held_out,
        "blocks",
        1,
    )
    fixed = {
        "fold": np.full(len(columns["pose"]), fold),
        "set": np.zeros(len(columns["pose"]), int),
    }
    write_table(tmp_path / "entries.parquet", ENTRIES, [fixed | columns], {})
    found = read_table(tmp_path / "entries.parquet", ENTRIES)
    np.testing.assert_array_equal(residual(found), residual(columns))
    assert set(found["pose"]) == set(data.folds["pose"][data.folds["blocks"] == fold])


@pytest.fixture(scope="module")
def diagnosed(kuka, config_folder, tmp_path_factory):
    folder = tmp_path_factory.mktemp("diagnosed") / "made"
    make_folder(folder, kuka, table=make_table(kuka, "made", offset_of_joint_3=1e-3))
    case, _ = read_cases(folder, config_folder / "robots")
    return case, diagnose(case, Settings(), 1)


def test_the_fit_of_a_fold_is_that_which_its_diagnosis_left(diagnosed):
    case, found = diagnosed
    again = refit_step(case, serialize_diagnosis(found)["steps"][-1])
    assert [effect.key for effect in again.model.effects] == [
        effect.key for effect in found.final.model.effects
    ]
    np.testing.assert_allclose(again.residual, found.final.residual, atol=2e-8)
    assert len(fit_physics(GEOMETRY, case).model.effects) < len(again.model.effects)


def test_mechanisms_have_their_probability_and_the_share_that_they_explain(diagnosed):
    columns = tabulate_mechanisms(diagnosed[1], 3)
    assert set(columns["fold"]) == {3} and columns["mechanism"][0] == "joint_offset"
    # One milliradian where the noise is 60 um: nearly all of the error.
    assert columns["probability"][0] > 0.99 and 0.7 < columns["share"][0] <= 1.0
    assert (np.asarray(columns["share"])[1:] < 0.1).all()
