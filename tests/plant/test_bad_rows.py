"""Slips that are planted in a measured table: each changes what it says, in so many rows."""

import numpy as np
import pytest
from analysed_robots import ROBOTS

from elastocal_proof.plant.arm import arm_from_file, rotation_vector, turned
from elastocal_proof.plant.bad_rows import SLIPS, with_bad_rows
from elastocal_proof.plant.campaigns import Design, measured_table, schedule_of
from elastocal_proof.plant.physical_robot import specimen

DESIGN = Design(poses=20, held_out=6, ladder=(0.0, 1.0), repeats=2, repeated_poses=3, points=("3DoF", "flange"), covariates=())
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
    arm = arm_from_file(ROBOTS / "kuka.yaml")
    robot, schedule = specimen(arm, 4), schedule_of(arm, DESIGN, 4)
    return measured_table(robot, DESIGN, schedule)[0], robot, schedule


def planted(campaign, kind, seed, count=3):
    return with_bad_rows(*campaign, kind, count, np.random.default_rng(seed))


def changed(before, after):
    """Columns and rows in which two tables differ."""
    off = {name: np.flatnonzero(before[name] != after[name]).tolist() for name in before}
    return {name for name, rows in off.items() if rows}, {row for rows in off.values() for row in rows}


@pytest.mark.parametrize("kind", SLIPS)
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
        read = [campaign[0][name][row - 1] if kind == "held_point" else 0.0 for name in READ]
        assert [after[name][row] for name in READ] == read
    # What is given is left alone.
    assert all((before[name] == campaign[0][name]).all() for name in before)


def test_sizes_of_wrong_positions_and_rotations_are_within_what_is_drawn(campaign):
    for seed in range(20):
        (there, (moved,)), (turn, (slip,)) = (planted(campaign, kind, seed, 1) for kind in ("position", "rotation"))
        away = np.linalg.norm([there[axis][moved["rows"][0]] - campaign[0][axis][moved["rows"][0]] for axis in "xyz"])
        assert 5 * 60e-6 <= away <= 1e5 * 60e-6
        before, then = (turned(np.array([t[f"r{a}"][slip["rows"][0]] for a in "xyz"])) for t in (campaign[0], turn))
        assert 5 * 60e-6 - 1e-9 <= np.linalg.norm(rotation_vector(then @ before.T)) <= np.pi + 1e-9


def test_a_wrong_angle_stays_within_the_limits_and_is_of_the_whole_pose_where_a_reader_would_refuse_it(campaign):
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
    largest = max(np.linalg.norm([table[f"f{axis}"][row] for axis in "xyz"]) for row in range(len(table["pose"])))
    for seed in range(20):
        after, (slip,) = planted(campaign, "load", seed, 1)
        row = slip["rows"][0]
        before, then = (np.array([t[f"f{axis}"][row] for axis in "xyz"]) for t in (table, after))
        assert table["load"][row] > 0
        assert np.linalg.norm(np.cross(before, then)) < 1e-9 * np.linalg.norm(before) * np.linalg.norm(then)
        assert np.linalg.norm(then - before) <= 100.0001 * largest
