"""Simulated campaigns follow from their seed, and a blunder changes its columns in its
rows only."""

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

POSE_COLUMNS = {"x", "y", "z", "rx", "ry", "rz"}


def test_the_default_design_is_a_ladder_at_thirty_poses_with_repeats_on_ten(fanuc_arm):
    schedule = draw_schedule(fanuc_arm, Design(), 1)
    assert len(schedule.pose) == 30 * 5 + 10 * 3 * 2
    assert np.unique(schedule.pose).size == 30
    full_load = schedule.force[schedule.load == 1]
    np.testing.assert_allclose(np.linalg.norm(full_load, axis=1), 1000.0)
    np.testing.assert_allclose(schedule.force[schedule.load == 4][0], -full_load[0])
    assert not schedule.force[schedule.load == 0].any()
    assert set(schedule.pose[schedule.repeat > 0]) == set(range(10))
    assert set(schedule.load[schedule.repeat > 0]) == {0, 1}
    low, high = fanuc_arm.limits.T
    assert (schedule.angle >= low).all() and (schedule.angle <= high).all()
    assert (np.diff(schedule.time_s) > 0).all()


def test_a_defect_changes_the_measurements_and_neither_the_schedule_nor_the_noise(
    fanuc_specimen, short_design
):
    schedule = draw_schedule(fanuc_specimen.arm, short_design, 2)
    defective = apply_defects(fanuc_specimen, [Defect("joint_offset", (2,), 1e-4, 1)])
    faultless_table, defective_table = (
        simulate_measurements(robot, short_design, schedule)
        for robot in (fanuc_specimen, defective)
    )
    for name, column in faultless_table.items():
        unchanged = np.array_equal(column, defective_table[name])
        assert unchanged == (name not in POSE_COLUMNS)
    shift = np.hypot(
        faultless_table["x"] - defective_table["x"],
        faultless_table["z"] - defective_table["z"],
    )
    assert shift.max() < 1e-4 * 4.0


@pytest.mark.parametrize("approach_each_load", [True, False])
def test_repeats_come_from_the_same_side_and_loads_without_a_move_too(
    fanuc_arm, short_design, approach_each_load
):
    design = replace(short_design, approach_each_load=approach_each_load)
    schedule = draw_schedule(fanuc_arm, design, 2)
    for pose in range(short_design.repeated_poses):
        for load in (0, 1):
            repeats = (schedule.pose == pose) & (schedule.load == load)
            senses = schedule.sense[repeats]
            assert (senses == senses[0]).all()
    senses = schedule.sense[schedule.pose == 0]
    assert (senses == senses[0]).all() != approach_each_load
    assert (schedule.previous < 0).all() == approach_each_load


def test_in_the_trackers_frame_all_measurements_are_moved_as_one_body(
    fanuc_specimen, short_design
):
    tracker = Tracker(sigma_m=0.0, sigma_rad=0.0, frame_turn=(0.2, 0.1, -0.7))
    robot = replace(fanuc_specimen, tracker=tracker)
    schedule = draw_schedule(fanuc_specimen.arm, short_design, 2)
    positions = []
    for frame in ("base", "tracker"):
        design = replace(short_design, frame=frame)
        table = simulate_measurements(robot, design, schedule)
        positions.append(np.column_stack([table[axis] for axis in "xyz"]))
    distances = [
        np.linalg.norm(position[:, None] - position, axis=-1) for position in positions
    ]
    np.testing.assert_allclose(*distances, atol=1e-12)
    assert np.abs(positions[0] - positions[1]).max() > 1.0


DESIGN = Design(
    poses=20,
    held_out=6,
    ladder=(0.0, 1.0),
    repeats=2,
    repeated_poses=3,
    points=("3DoF", "6DoF"),
    covariates=(),
)
# Columns that a blunder of each kind may change.
BLUNDER_COLUMNS = {
    "position": {"x", "y", "z"},
    "rotation": {"rx", "ry", "rz"},
    "joint_angle": {f"q{joint}" for joint in range(1, 7)},
    "load": {"fx", "fy", "fz", "mx", "my", "mz"},
    "held_point": POSE_COLUMNS,
    "zeros": POSE_COLUMNS,
    "swapped": POSE_COLUMNS,
}


@pytest.fixture(scope="module")
def campaign():
    """Table, robot and schedule."""
    arm = read_arm(ROBOTS / "kuka.yaml")
    robot = draw_specimen(arm, 4)
    schedule = draw_schedule(arm, DESIGN, 4)
    return simulate_measurements(robot, DESIGN, schedule), robot, schedule


def corrupt(campaign, kind, seed, count=3):
    """The campaign's table with blunders, and these."""
    return add_blunders(*campaign, kind, count, np.random.default_rng(seed))


def find_differences(before, after):
    """Names of the columns and numbers of the rows in which two tables differ."""
    differs = {name: before[name] != after[name] for name in before}
    rows = np.any([*differs.values()], axis=0)
    columns = {name for name, different in differs.items() if different.any()}
    return columns, set(np.flatnonzero(rows).tolist())


def read_vector(table, names, row):
    return np.array([table[name][row] for name in names])


@pytest.mark.parametrize("kind", BLUNDER_KINDS)
@pytest.mark.parametrize("seed", range(5))
def test_a_blunder_changes_its_columns_in_its_rows_only(campaign, kind, seed):
    table = campaign[0]
    original = {name: column.copy() for name, column in table.items()}
    corrupted, blunders = corrupt(campaign, kind, seed)
    columns, rows = find_differences(table, corrupted)
    assert columns and columns <= BLUNDER_COLUMNS[kind]
    assert rows == set().union(*(blunder["rows"] for blunder in blunders))
    assert len(blunders) == (2 if kind == "swapped" else 3)
    first_rows = [blunder["rows"][0] for blunder in blunders]
    assert len(set(table["pose"][first_rows])) == len(blunders)
    assert {blunder["kind"] for blunder in blunders} == {kind}
    for row in first_rows:
        readings = read_vector(corrupted, POSE_COLUMNS, row)
        if kind == "held_point":
            previous = read_vector(table, POSE_COLUMNS, row - 1)
            np.testing.assert_array_equal(readings, previous)
        elif kind == "zeros":
            assert not readings.any()
    # The given table is not changed.
    assert all((original[name] == table[name]).all() for name in original)


@pytest.mark.parametrize("seed", range(20))
def test_wrong_positions_and_rotations_are_as_large_as_drawn(campaign, seed):
    table = campaign[0]
    corrupted, (blunder,) = corrupt(campaign, "position", seed, 1)
    row = blunder["rows"][0]
    shift = read_vector(corrupted, "xyz", row) - read_vector(table, "xyz", row)
    assert 5 * 60e-6 <= np.linalg.norm(shift) <= 1e5 * 60e-6
    corrupted, (blunder,) = corrupt(campaign, "rotation", seed, 1)
    before, after = (
        to_rotation_matrix(read_vector(data, ("rx", "ry", "rz"), blunder["rows"][0]))
        for data in (table, corrupted)
    )
    angle = np.linalg.norm(to_rotation_vector(after @ before.T))
    assert 5 * 60e-6 - 1e-9 <= angle <= np.pi + 1e-9


def test_a_wrong_angle_is_within_the_limits_and_affects_the_whole_pose_if_it_is_large(
    campaign,
):
    """A reader would refuse a large error in single rows of a pose."""
    table, robot, _ = campaign
    affected = set()
    for seed in range(40):
        corrupted, blunders = corrupt(campaign, "joint_angle", seed, 1)
        (name,), rows = find_differences(table, corrupted)
        error = corrupted[name] - table[name]
        same_pose = table["pose"] == table["pose"][blunders[0]["rows"][0]]
        is_whole_pose = rows == set(np.flatnonzero(same_pose).tolist())
        assert is_whole_pose or np.abs(error).max() < 0.02
        affected.add("pose" if is_whole_pose else len(rows))
        angles = np.column_stack([corrupted[f"q{joint}"] for joint in range(1, 7)])
        low, high = robot.arm.limits.T
        assert ((angles >= low - 1e-9) & (angles <= high + 1e-9)).all()
    assert affected == {"pose", 1, 2}


def test_a_wrong_load_keeps_its_direction_and_is_bounded(campaign):
    table = campaign[0]
    forces = np.column_stack([table[name] for name in ("fx", "fy", "fz")])
    largest = np.linalg.norm(forces, axis=1).max()
    for seed in range(20):
        corrupted, (blunder,) = corrupt(campaign, "load", seed, 1)
        row = blunder["rows"][0]
        wrong = read_vector(corrupted, ("fx", "fy", "fz"), row)
        assert table["load"][row] > 0
        product = np.linalg.norm(forces[row]) * np.linalg.norm(wrong)
        assert np.linalg.norm(np.cross(forces[row], wrong)) < 1e-9 * product
        assert np.linalg.norm(wrong - forces[row]) <= 100.0001 * largest
