"""Campaigns of the plant: what is done and what is read, and that all of it follows from the seed."""

from dataclasses import replace

import numpy as np

from elastocal_proof.plant.campaigns import Design, measured_table, schedule_of
from elastocal_proof.plant.kinds import Defect, with_defects
from elastocal_proof.plant.physical_robot import Tracker


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


def test_a_defect_changes_the_measurements_and_neither_the_schedule_nor_the_noise(fanuc_specimen, small):
    schedule = schedule_of(fanuc_specimen.arm, small, 2)
    bad = with_defects(fanuc_specimen, [Defect("joint_offset", (2,), 1e-4, 1)])
    good_table, bad_table = (measured_table(robot, small, schedule)[0] for robot in (fanuc_specimen, bad))
    for column in good_table:
        assert (column in ("x", "y", "z", "rx", "ry", "rz")) != np.array_equal(good_table[column], bad_table[column])
    at_shoulder = np.hypot(good_table["x"] - bad_table["x"], good_table["z"] - bad_table["z"])
    assert at_shoulder.max() < 1e-4 * 4.0


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


def test_in_the_trackers_frame_all_measurements_are_moved_as_one_body(fanuc_specimen, small):
    tracker = Tracker(sigma_m=0.0, sigma_rad=0.0, frame_turn=(0.2, 0.1, -0.7))
    robot, schedule = replace(fanuc_specimen, tracker=tracker), schedule_of(fanuc_specimen.arm, small, 2)
    here, there = (measured_table(robot, replace(small, frame=frame), schedule)[0] for frame in ("base", "tracker"))
    one, other = (np.column_stack([table[axis] for axis in "xyz"]) for table in (here, there))
    distances = [np.linalg.norm(points[:, None] - points, axis=-1) for points in (one, other)]
    np.testing.assert_allclose(*distances, atol=1e-12)
    assert np.abs(one - other).max() > 1.0
