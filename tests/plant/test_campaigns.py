"""Campaigns of the plant: what is done and read follows from the seed, and a slip
changes what it says in so many rows."""

from dataclasses import replace

import numpy as np
import pytest
from analysed_robots import ROBOTS

from elastocal_proof.plant.arm import read_arm, to_rotation_matrix, to_rotation_vector
from elastocal_proof.plant.campaigns import (
    BLUNDER_KINDS,
    Design,
    add_blunders,
    draw_schedule,
    simulate_measurements,
)
from elastocal_proof.plant.kinds import Defect, apply_defects
from elastocal_proof.plant.simulated_robot import Tracker, draw_specimen


def test_the_default_design_is_a_ladder_at_thirty_poses_with_repeats_on_ten(fanuc_arm):
    schedule = draw_schedule(fanuc_arm, Design(), 1)
    assert len(schedule.pose) == 30 * 5 + 10 * 3 * 2
    assert np.unique(schedule.pose).size == 30
    np.testing.assert_allclose(
        np.linalg.norm(schedule.force[schedule.load == 1], axis=1), 1000.0
    )
    np.testing.assert_allclose(
        schedule.force[schedule.load == 4][0], -schedule.force[schedule.load == 1][0]
    )
    assert not schedule.force[schedule.load == 0].any()
    assert set(schedule.pose[schedule.repeat > 0]) == set(range(10))
    assert set(schedule.load[schedule.repeat > 0]) == {0, 1}
    low, high = fanuc_arm.limits.T
    assert (schedule.angle >= low).all() and (schedule.angle <= high).all()
    assert (np.diff(schedule.time_s) > 0).all()


def test_a_defect_changes_the_measurements_and_neither_the_schedule_nor_the_noise(
    fanuc_specimen, small
):
    schedule = draw_schedule(fanuc_specimen.arm, small, 2)
    bad = apply_defects(fanuc_specimen, [Defect("joint_offset", (2,), 1e-4, 1)])
    good_table, bad_table = (
        simulate_measurements(robot, small, schedule) for robot in (fanuc_specimen, bad)
    )
    for column in good_table:
        assert (column in ("x", "y", "z", "rx", "ry", "rz")) != np.array_equal(
            good_table[column], bad_table[column]
        )
    at_shoulder = np.hypot(
        good_table["x"] - bad_table["x"], good_table["z"] - bad_table["z"]
    )
    assert at_shoulder.max() < 1e-4 * 4.0


def test_a_repeat_comes_from_the_same_side_and_a_ladder_without_moves_from_one(
    fanuc_arm, small
):
    for each in (True, False):
        schedule = draw_schedule(fanuc_arm, replace(small, approach_each_load=each), 2)
        for pose in range(small.repeated_poses):
            for load in (0, 1):
                rows = schedule.sense[(schedule.pose == pose) & (schedule.load == load)]
                assert (rows == rows[0]).all()
        first = schedule.sense[(schedule.pose == 0)]
        assert (first == first[0]).all() != each
        assert (schedule.previous < 0).all() == each


def test_in_the_trackers_frame_all_measurements_are_moved_as_one_body(
    fanuc_specimen, small
):
    tracker = Tracker(sigma_m=0.0, sigma_rad=0.0, frame_turn=(0.2, 0.1, -0.7))
    robot = replace(fanuc_specimen, tracker=tracker)
    schedule = draw_schedule(fanuc_specimen.arm, small, 2)
    here, there = (
        simulate_measurements(robot, replace(small, frame=frame), schedule)
        for frame in ("base", "tracker")
    )
    one, other = (
        np.column_stack([table[axis] for axis in "xyz"]) for table in (here, there)
    )
    distances = [
        np.linalg.norm(points[:, None] - points, axis=-1) for points in (one, other)
    ]
    np.testing.assert_allclose(*distances, atol=1e-12)
    assert np.abs(one - other).max() > 1.0


DESIGN = Design(
    poses=20,
    held_out=6,
    ladder=(0.0, 1.0),
    repeats=2,
    repeated_poses=3,
    points=("3DoF", "6DoF"),
    covariates=(),
)
READ = {"x", "y", "z", "rx", "ry", "rz"}
MAY_CHANGE = {
    "position": {"x", "y", "z"},
    "rotation": {"rx", "ry", "rz"},
    "joint_angle": {f"q{joint}" for joint in range(1, 7)},
    "load": {"fx", "fy", "fz", "mx", "my", "mz"},
    "held_point": READ,
    "zeros": READ,
    "swapped": READ,
}


@pytest.fixture(scope="module")
def campaign():
    arm = read_arm(ROBOTS / "kuka.yaml")
    robot = draw_specimen(arm, 4)
    schedule = draw_schedule(arm, DESIGN, 4)
    return simulate_measurements(robot, DESIGN, schedule), robot, schedule


def planted(campaign, kind, seed, count=3):
    return add_blunders(*campaign, kind, count, np.random.default_rng(seed))


def changed(before, after):
    """Columns and rows in which two tables differ."""
    off = {
        name: np.flatnonzero(before[name] != after[name]).tolist() for name in before
    }
    return {name for name, rows in off.items() if rows}, {
        row for rows in off.values() for row in rows
    }


@pytest.mark.parametrize("kind", BLUNDER_KINDS)
@pytest.mark.parametrize("seed", range(5))
def test_a_slip_changes_its_columns_in_its_rows_and_no_others(campaign, kind, seed):
    before = {name: column.copy() for name, column in campaign[0].items()}
    after, slips = planted(campaign, kind, seed)
    columns, rows = changed(campaign[0], after)
    assert columns and columns <= MAY_CHANGE[kind]
    assert rows == {row for slip in slips for row in slip["rows"]}
    assert len(slips) == (2 if kind == "swapped" else 3)
    assert len({campaign[0]["pose"][slip["rows"][0]] for slip in slips}) == len(slips)
    assert all(slip["kind"] == kind for slip in slips)
    for row in [slip["rows"][0] for slip in slips if kind in ("held_point", "zeros")]:
        read = [
            campaign[0][name][row - 1] if kind == "held_point" else 0.0 for name in READ
        ]
        assert [after[name][row] for name in READ] == read
    # What is given is left alone.
    assert all((before[name] == campaign[0][name]).all() for name in before)


def test_sizes_of_wrong_positions_and_rotations_are_within_what_is_drawn(campaign):
    for seed in range(20):
        (there, (moved,)), (turn, (slip,)) = (
            planted(campaign, kind, seed, 1) for kind in ("position", "rotation")
        )
        away = np.linalg.norm(
            [
                there[axis][moved["rows"][0]] - campaign[0][axis][moved["rows"][0]]
                for axis in "xyz"
            ]
        )
        assert 5 * 60e-6 <= away <= 1e5 * 60e-6
        before, then = (
            to_rotation_matrix(np.array([t[f"r{a}"][slip["rows"][0]] for a in "xyz"]))
            for t in (campaign[0], turn)
        )
        assert (
            5 * 60e-6 - 1e-9
            <= np.linalg.norm(to_rotation_vector(then @ before.T))
            <= np.pi + 1e-9
        )


def test_a_wrong_angle_stays_within_the_limits_and_is_of_the_whole_pose_where_a_reader_would_refuse_it(
    campaign,
):
    table, robot, _ = campaign
    kinds = set()
    for seed in range(40):
        after, slips = planted(campaign, "joint_angle", seed, 1)
        (name,), rows = changed(table, after)
        off = after[name] - table[name]
        pose = table["pose"] == table["pose"][slips[0]["rows"][0]]
        whole = rows == set(np.flatnonzero(pose).tolist())
        assert whole or np.abs(off).max() < 0.02
        kinds.add("pose" if whole else len(rows))
        angles = np.column_stack([after[f"q{joint}"] for joint in range(1, 7)])
        low, high = robot.arm.limits.T
        assert ((angles >= low - 1e-9) & (angles <= high + 1e-9)).all()
    assert kinds == {"pose", 1, 2}


def test_a_wrong_load_keeps_its_line_and_is_bounded(campaign):
    table = campaign[0]
    largest = max(
        np.linalg.norm([table[f"f{axis}"][row] for axis in "xyz"])
        for row in range(len(table["pose"]))
    )
    for seed in range(20):
        after, (slip,) = planted(campaign, "load", seed, 1)
        row = slip["rows"][0]
        before, then = (
            np.array([t[f"f{axis}"][row] for axis in "xyz"]) for t in (table, after)
        )
        assert table["load"][row] > 0
        assert np.linalg.norm(np.cross(before, then)) < 1e-9 * np.linalg.norm(
            before
        ) * np.linalg.norm(then)
        assert np.linalg.norm(then - before) <= 100.0001 * largest
