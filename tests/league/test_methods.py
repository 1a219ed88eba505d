"""All methods have the same folds, and predict the poses that are held out."""

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
from elastocal.loop.schemas import MEASUREMENTS
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
def robots_folder(config_folder):
    return config_folder / "robots"


@pytest.fixture(scope="module")
def data(kuka, robots_folder, tmp_path_factory):
    return make_data_set(tmp_path_factory.mktemp("data_set"), kuka, robots_folder)


def test_every_pose_is_in_one_fold_and_folds_have_equal_sizes(data):
    measured = build_measurements(data.columns)
    folds = deal_folds(measured, 5, np.random.default_rng(2))
    assert len(folds["pose"]) == 24
    for split in ("random", "blocks"):
        counts = np.bincount(folds[split])
        assert counts[0] == 0
        assert len(counts) == 6
        assert np.ptp(counts[1:]) <= 1


def test_poses_of_one_block_are_close_in_joint_space(data):
    measured = build_measurements(data.columns)
    angles = measured.joint_angles[np.unique(measured.pose, return_index=True)[1]]
    points = np.exp(1j * angles)
    distance = np.linalg.norm(points[:, None] - points, axis=2)
    block = data.folds["blocks"]
    same_block = block[:, None] == block
    different_pose = ~np.eye(24, dtype=bool)
    distance_within = distance[same_block & different_pose].mean()
    assert distance_within < 0.95 * distance[~same_block].mean()


def test_a_data_set_is_read_back_from_its_files(data, tmp_path):
    descriptions, measurements, folds = (
        tmp_path / name for name in ("campaign.json", "seen.parquet", "folds.parquet")
    )
    write_json(descriptions, data.descriptions)
    write_table(measurements, MEASUREMENTS.for_joints(6), [data.columns], {})
    write_table(folds, FOLDS, [data.folds], {})
    loaded = load_data_set(descriptions, measurements, folds)
    for name, values in data.columns.items():
        np.testing.assert_array_equal(loaded.columns[name], values)
    for name, values in data.folds.items():
        np.testing.assert_array_equal(loaded.folds[name], values)
    assert len(loaded.build_case().observations.states) == 24


def list_case_poses(case):
    return set(case.observations.states.pose)


@pytest.mark.parametrize("split", ["random", "blocks"])
def test_the_poses_of_a_fold_are_either_trained_on_or_held_out(data, split):
    all_held_out = []
    for _, training, (test,) in split_rounds(split, data):
        trained = list_case_poses(training)
        held_out = list_case_poses(test)
        assert not trained & held_out
        assert len(trained | held_out) == 24
        all_held_out += held_out
    assert sorted(all_held_out) == list(range(24))


def test_all_poses_of_another_session_test_all_poses_of_this_one(
    data, kuka, robots_folder, tmp_path
):
    session = make_data_set(
        tmp_path, kuka, robots_folder, poses=8, seed=3, name="other"
    )
    ((fold, training, tests),) = split_rounds("session", data, [session])
    assert fold == 1
    assert len(training.observations.states) == 24
    assert [test.campaign.name for test in tests] == ["other"]
    assert len(tests[0].observations.states) == 8


def stack_residuals(columns):
    return np.column_stack([columns[f"d{axis}"] for axis in "xyz"])


@pytest.fixture(scope="module")
def large_round(kuka, robots_folder, tmp_path_factory):
    """Training and held-out poses of a fold of 60 poses."""
    folder = tmp_path_factory.mktemp("large")
    data = make_data_set(folder, kuka, robots_folder, poses=60)
    _, training, (held_out,) = next(split_rounds("random", data))
    return training, held_out


def test_a_fit_of_frames_has_no_parameters_of_the_robot(large_round):
    frames = fit_physics(FRAMES, large_round[0])
    geometry = fit_physics(GEOMETRY, large_round[0])
    owners_of_frames = {owner for owner, _ in frames.parameters}
    owners_of_geometry = {owner for owner, _ in geometry.parameters}
    assert all(owner.startswith(("frame ", "target ")) for owner in owners_of_frames)
    effects = {
        owner.partition("@")[0] for owner in owners_of_geometry - owners_of_frames
    }
    assert effects == {"joint_offset"}


def test_a_regression_lowers_the_residual_of_geometry_and_states_deviations(
    large_round,
):
    training, held_out = large_round
    geometry = fit_physics(GEOMETRY, training)
    without, with_process = (
        predict_held_out(
            Method(GEOMETRY, regression), geometry, training, held_out, "random", 1
        )
        for regression in (None, "gaussian_process")
    )
    squares_without = (stack_residuals(without) ** 2).sum()
    assert (stack_residuals(with_process) ** 2).sum() < 0.64 * squares_without
    assert np.isfinite(with_process["std_x"]).all()
    assert np.isnan(without["std_x"]).all()


def test_an_unknown_regression_is_refused():
    description = {"physics": "geometry", "regression": "magic", "words": ""}
    with pytest.raises(
        InputError,
        match=r"league\.methods\.mine\.regression.*'magic'.*gaussian_process",
    ):
        parse_method(description, "mine", "config.yaml")


def test_a_method_without_regression_is_parsed():
    description = {"physics": "frames", "words": "frames only"}
    method = parse_method(description, "mine", "config.yaml")
    assert method.words == "frames only"


def test_each_observation_has_its_pose_target_and_residual(data, tmp_path):
    fold, training, (held_out,) = next(split_rounds("blocks", data))
    fitted = fit_physics(GEOMETRY, training)
    columns = predict_held_out(
        Method(GEOMETRY), fitted, training, held_out, "blocks", 1
    )
    count = len(columns["pose"])
    numbers = {"fold": np.full(count, fold), "set": np.zeros(count, int)}
    write_table(tmp_path / "entries.parquet", ENTRIES, [numbers | columns], {})
    loaded = read_table(tmp_path / "entries.parquet", ENTRIES)
    np.testing.assert_array_equal(stack_residuals(loaded), stack_residuals(columns))
    in_fold = data.folds["blocks"] == fold
    assert set(loaded["pose"]) == set(data.folds["pose"][in_fold])


@pytest.fixture(scope="module")
def diagnosed(kuka, robots_folder, tmp_path_factory):
    """A case with a wrong joint offset, and its diagnosis."""
    folder = tmp_path_factory.mktemp("diagnosed") / "made"
    make_folder(folder, kuka, table=make_table(kuka, "made", offset_of_joint_3=1e-3))
    case, _ = read_cases(folder, robots_folder)
    return case, diagnose(case, Settings(), 1)


def test_the_last_fit_of_a_diagnosis_is_rebuilt_from_its_facts(diagnosed):
    case, diagnosis = diagnosed
    rebuilt = refit_step(case, serialize_diagnosis(diagnosis)["steps"][-1])
    assert [effect.key for effect in rebuilt.model.effects] == [
        effect.key for effect in diagnosis.final.model.effects
    ]
    np.testing.assert_allclose(rebuilt.residual, diagnosis.final.residual, atol=2e-8)
    declared = fit_physics(GEOMETRY, case)
    assert len(declared.model.effects) < len(rebuilt.model.effects)


def test_mechanisms_have_their_probability_and_the_share_that_they_explain(diagnosed):
    columns = tabulate_mechanisms(diagnosed[1], 3)
    assert set(columns["fold"]) == {3}
    assert columns["mechanism"][0] == "joint_offset"
    # One milliradian is nearly all of the error, because the noise is 60 um.
    assert columns["probability"][0] > 0.99
    assert 0.7 < columns["share"][0] <= 1.0
    assert (np.asarray(columns["share"])[1:] < 0.1).all()
