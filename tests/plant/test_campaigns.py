"""Campaigns of the plant: what the folder holds, what it must not hold, and that all of it follows from the seed."""

import hashlib
import json
from dataclasses import replace

import numpy as np
import pytest
import yaml
from analysed_robots import ROBOTS

from elastocal.blind.folders import write_blind_campaign, write_truth
from elastocal.campaigns.holdout import split
from elastocal.campaigns.reading import read_campaign
from elastocal.plant.arm import arm_from_file
from elastocal.plant.campaigns import Design, continued, measured_table, schedule_of
from elastocal.plant.defects import Defect, drawn_defect, truth_of, with_defects
from elastocal.plant.physical_robot import Warmth, seen_poses, specimen
from elastocal.plant.tracker import Tracker, rotation_vector
from elastocal.plant.weights import declared_masses

FILES = ["campaign.yaml", "measurements.parquet", "robot.yaml"]


def made(folder, robot, design, seed=2, **more):
    return write_blind_campaign(
        folder, "case0", ROBOTS / "fanuc.yaml", robot, design, schedule_of(robot.arm, design, seed), **more
    )


def test_the_default_design_is_a_ladder_at_thirty_poses_with_repeats_on_ten(fanuc_arm):
    schedule = schedule_of(fanuc_arm, Design(), 1)
    assert len(schedule.pose) == 30 * 5 + 10 * 3 * 2
    assert np.unique(schedule.pose).size == 30
    np.testing.assert_allclose(np.linalg.norm(schedule.force[schedule.load == 1], axis=1), 1000.0)
    np.testing.assert_allclose(schedule.force[schedule.load == 4][0], -schedule.force[schedule.load == 1][0])
    assert not schedule.force[schedule.load == 0].any()
    assert set(schedule.pose[schedule.repeat > 0]) == set(range(10))
    assert set(schedule.load[schedule.repeat > 0]) == {0, 1}
    low, high = fanuc_arm.limits.T
    assert (schedule.angle >= low).all() and (schedule.angle <= high).all()
    assert (np.diff(schedule.time_s) > 0).all()


@pytest.mark.parametrize("kind", ["parquet", "csv"])
def test_the_analysis_reads_the_folder_and_holds_out_the_designed_poses(tmp_path, fanuc_specimen, small, kind):
    made(tmp_path / "case0", fanuc_specimen, small, kind=kind)
    campaign = read_campaign(tmp_path / "case0", ROBOTS)
    training, held_out = split(campaign)
    schedule = schedule_of(fanuc_specimen.arm, small, 2)
    assert set(training.pose) == set(schedule.pose[schedule.training])
    assert set(held_out.pose) == set(schedule.pose[~schedule.training])
    assert len(campaign.measurements.pose) == 4 * len(schedule.pose)


@pytest.mark.parametrize("name", ["kuka", "fanuc", "abb", "fanuc_cpa"])
def test_angles_stand_in_the_folder_as_the_controller_shows_them(tmp_path, small, name):
    robot = specimen(arm_from_file(ROBOTS / f"{name}.yaml"), 1)
    write_blind_campaign(tmp_path / "c", "c", ROBOTS / f"{name}.yaml", robot, small, schedule_of(robot.arm, small, 2))
    measurements = read_campaign(tmp_path / "c", ROBOTS).measurements
    np.testing.assert_allclose(measurements.joint_angles[::4], schedule_of(robot.arm, small, 2).angle, atol=1e-12)


def test_the_same_seed_gives_the_same_bytes_and_another_seed_other_measurements(tmp_path, fanuc_specimen, small):
    for folder, seed in (("a", 2), ("b", 2), ("c", 3)):
        made(tmp_path / folder, fanuc_specimen, small, seed)
    bytes_of = [(tmp_path / folder / "measurements.parquet").read_bytes() for folder in "abc"]
    assert bytes_of[0] == bytes_of[1]
    assert bytes_of[0] != bytes_of[2]


def test_a_defect_changes_the_measurements_and_neither_the_schedule_nor_the_noise(fanuc_specimen, small):
    schedule = schedule_of(fanuc_specimen.arm, small, 2)
    bad = with_defects(fanuc_specimen, [Defect("joint_offset", (2,), 1e-4, 1)])
    good_table, bad_table = (measured_table(robot, small, schedule)[0] for robot in (fanuc_specimen, bad))
    for column in good_table:
        assert (column in ("x", "y", "z", "rx", "ry", "rz")) != np.array_equal(good_table[column], bad_table[column])
    at_shoulder = np.hypot(good_table["x"] - bad_table["x"], good_table["z"] - bad_table["z"])
    assert at_shoulder.max() < 1e-4 * 4.0


def test_noise_of_the_measurements_is_the_trackers(fanuc_specimen, small):
    design = replace(small, poses=40)
    schedule = schedule_of(fanuc_specimen.arm, design, 2)
    noisy = measured_table(fanuc_specimen, design, schedule)[0]
    silent = replace(fanuc_specimen, tracker=Tracker(sigma_m=0.0, sigma_rad=0.0))
    clean = measured_table(silent, design, schedule)[0]
    for axis in "xyz":
        assert np.std(noisy[axis] - clean[axis]) == pytest.approx(60e-6, rel=0.06)


def test_a_repeat_comes_from_the_same_side_and_a_ladder_without_moves_from_one(fanuc_arm, small):
    for each in (True, False):
        schedule = schedule_of(fanuc_arm, replace(small, approach_each_load=each), 2)
        for pose in range(small.repeated_poses):
            for load in (0, 1):
                rows = schedule.sense[(schedule.pose == pose) & (schedule.load == load)]
                assert (rows == rows[0]).all()
        first = schedule.sense[(schedule.pose == 0)]
        assert (first == first[0]).all() != each
        assert (schedule.previous < 0).all() == each


def test_loads_without_a_move_share_their_approach(fanuc_arm, small):
    schedule = schedule_of(fanuc_arm, replace(small, approach_each_load=False), 2)
    for state in np.flatnonzero(schedule.previous >= 0):
        assert schedule.previous[state] == state - 1
        assert schedule.approach[state] == schedule.approach[state - 1]
        assert (schedule.pose[state], schedule.repeat[state]) == (schedule.pose[state - 1], schedule.repeat[state - 1])
    assert len(np.unique(schedule.approach)) == (schedule.load == 0).sum()


def test_covariates_may_be_left_out_and_declared_noise_may_be_wrong(tmp_path, fanuc_specimen, small):
    design = replace(
        small,
        covariates=("time",),
        declared_noise=(3e-5, 3e-5),
        declared=("joint_offset",),
        points=("6DoF",),
        measured="position",
    )
    made(tmp_path / "case0", fanuc_specimen, design)
    campaign = read_campaign(tmp_path / "case0", ROBOTS)
    assert campaign.noise == {"position_m": 3e-5, "orientation_rad": 3e-5}
    assert campaign.declared == ("joint_offset",)
    assert campaign.measurements.approach is None
    assert campaign.measurements.temperature_c is None
    assert campaign.measurements.time_s is not None
    assert campaign.measurements.rotation_vector is None
    assert [target.point for target in campaign.targets] == ["6DoF"]


def test_in_the_trackers_frame_all_measurements_are_moved_as_one_body(fanuc_specimen, small):
    tracker = Tracker(sigma_m=0.0, sigma_rad=0.0, frame_turn=(0.2, 0.1, -0.7))
    robot, schedule = replace(fanuc_specimen, tracker=tracker), schedule_of(fanuc_specimen.arm, small, 2)
    here, there = (measured_table(robot, replace(small, frame=frame), schedule)[0] for frame in ("base", "tracker"))
    one, other = (np.column_stack([table[axis] for axis in "xyz"]) for table in (here, there))
    distances = [np.linalg.norm(points[:, None] - points, axis=-1) for points in (one, other)]
    np.testing.assert_allclose(*distances, atol=1e-12)
    assert np.abs(one - other).max() > 1.0


def test_outliers_are_named_in_the_truth_and_nowhere_else(tmp_path, fanuc_specimen, small):
    robot = replace(fanuc_specimen, tracker=Tracker(outliers=0.05, outlier_sigmas=50.0))
    truth = made(tmp_path / "bad", robot, small)
    made(tmp_path / "good", fanuc_specimen, small)
    bad, good = (read_campaign(tmp_path / folder, ROBOTS) for folder in ("bad", "good"))
    off = np.abs(bad.measurements.position - good.measurements.position).max(axis=1) > 0
    names = [target.name for target in bad.targets]
    found = {(int(row) // 4, names[bad.measurements.target[row]]) for row in np.flatnonzero(off)}
    assert found == {tuple(entry) for entry in truth["outliers"]}
    assert found


def test_the_folder_is_the_same_whatever_the_truth_but_for_the_measurements(tmp_path, fanuc_specimen, small):
    defect = Defect("lost_motion", (2,), 1e-4, 1)
    made(tmp_path / "good", fanuc_specimen, small)
    made(tmp_path / "bad", with_defects(fanuc_specimen, [defect]), small)
    assert sorted(path.name for path in (tmp_path / "bad").iterdir()) == FILES
    assert (tmp_path / "good/campaign.yaml").read_bytes() == (tmp_path / "bad/campaign.yaml").read_bytes()
    content = b"".join(path.read_bytes() for path in (tmp_path / "bad").iterdir())
    for word in (b"lost_motion", b"defect", b"truth", b"seed"):
        assert word not in content


def test_the_campaigns_robot_file_tells_the_declared_weights_and_nothing_where_none_are(tmp_path, fanuc_specimen, small):
    declared = declared_masses(fanuc_specimen.arm)
    truth = made(tmp_path / "told", fanuc_specimen, small, declared=declared)
    made(tmp_path / "hidden", fanuc_specimen, small)
    told, hidden = (yaml.safe_load((tmp_path / name / "robot.yaml").read_text()) for name in ("told", "hidden"))
    assert [(m["link"], m["mass_kg"]) for m in told["masses"]] == [(m.link, m.mass_kg) for m in declared]
    assert "masses" not in hidden and hidden == {key: value for key, value in told.items() if key != "masses"}
    assert told["chain"] == yaml.safe_load((ROBOTS / "fanuc.yaml").read_text())["chain"]
    off = [abs(m["mass_kg"] / d.mass_kg - 1) for m, d in zip(truth["masses"], declared, strict=True)]
    assert min(off) > 0 and max(off) < 0.31


def test_the_truth_is_sealed_outside_of_the_folder_by_its_hash(tmp_path, fanuc_specimen):
    truth = {"defects": [truth_of(fanuc_specimen, Defect("lost_motion", (2,), 1e-4, 1))]}
    sealed = tmp_path / "sealed" / "case0.json"
    digest = write_truth(sealed, truth, tmp_path / "blind" / "case0")
    assert digest == hashlib.sha256(sealed.read_bytes()).hexdigest()
    assert json.loads(sealed.read_text()) == truth
    with pytest.raises(ValueError, match="must not lie"):
        write_truth(tmp_path / "blind" / "case0" / "truth.json", truth, tmp_path / "blind" / "case0")


def test_castings_warm_up_behind_the_thermometer_and_reach_it():
    warmth, time = Warmth(10.0, 3000.0, 1200.0), np.linspace(0, 40000, 400)
    shown, castings = warmth.shown(time), warmth.of_castings(time)
    assert (castings[1:] < shown[1:]).all()
    assert castings[0] == shown[0] == 20.0
    np.testing.assert_allclose([shown[-1], castings[-1]], 30.0, atol=1e-3)
    # T_lag dT/dt = shown - castings.
    slope = np.gradient(castings, time)
    np.testing.assert_allclose(1200.0 * slope[5:-5], (shown - castings)[5:-5], atol=0.02)


def test_links_grow_in_proportion_to_their_castings_warmth(weightless, small):
    schedule = schedule_of(weightless.arm, small, 2)
    grown = seen_poses(replace(weightless, expansion_per_K=1e-5), schedule)
    nominal = seen_poses(weightless, schedule)
    unloaded = schedule.load == 0
    share = 1e-5 * (weightless.warmth.of_castings(schedule.time_s) - 20.0)
    np.testing.assert_allclose(grown[0][unloaded], (nominal[0] * (1 + share)[:, None, None])[unloaded], atol=1e-12)
    assert np.abs(rotation_vector(grown[1] @ np.swapaxes(nominal[1], -1, -2))[unloaded]).max() < 1e-12


@pytest.mark.parametrize("kind", ["frame_drift", "outside:slipping_zero", "hysteresis"])
def test_a_further_experiment_changes_no_measurement_that_is_there(fanuc_specimen, small, kind):
    robot = with_defects(fanuc_specimen, [drawn_defect(kind, fanuc_specimen.arm, 1)])
    robot = replace(robot, tracker=replace(robot.tracker, outliers=0.05))
    schedule = schedule_of(robot.arm, small, 2)
    angle = np.repeat(schedule.angle[[0, -1]] * 0.5, 2, axis=0)
    wrench = np.concatenate([schedule.shown_wrench[schedule.load == 1][:2], schedule.shown_wrench[schedule.load == 1][2:4]])
    longer = continued(schedule, angle, wrench)
    before, after = (measured_table(robot, small, given)[0] for given in (schedule, longer))
    for column in before:
        np.testing.assert_array_equal(before[column], after[column][: len(before[column])])
    rows = slice(len(schedule.pose), None)
    assert longer.load[rows].tolist() == [0, 1, 2, 0, 1, 2]
    assert longer.pose[rows].tolist() == [8, 8, 8, 9, 9, 9]
    np.testing.assert_allclose(longer.shown_wrench[rows][[1, 2, 4, 5]], wrench, atol=1e-9)
    assert not longer.shown_wrench[rows][[0, 3]].any()
    assert longer.training[rows].all()
    assert (np.diff(longer.time_s) > 0).all()
    ladder = continued(schedule, angle[::2], wrench[::2], ladder=(0.0, 1.0, -0.5))
    assert ladder.load[rows].tolist() == [0, 1, 2, 0, 1, 2]
    shares = np.array([0, 1, -0.5])[:, None]
    np.testing.assert_allclose(ladder.shown_wrench[rows], np.concatenate([shares * wrench[0], shares * wrench[2]]), atol=1e-9)
