from pathlib import Path

import numpy as np
import pytest
from made_folders import make_folder

import elastocal as ec

TOP = Path(__file__).resolve().parents[2]


def angles_and_positions(measured, nominal):
    angles = measured[[f"q{joint}" for joint in range(1, nominal.joints + 1)]]
    return angles.to_numpy(), measured[[*"xyz"]].to_numpy()


def test_arrays_and_table_make_the_same_campaign(nominal, measured):
    angles, positions = angles_and_positions(measured, nominal)
    columns = {name: measured[name] for name in ("pose", "load", "repeat")}
    wrenches = measured[["fx", "fy", "fz", "mx", "my", "mz"]]
    arrays = ec.Campaign(
        nominal,
        joint_angles=angles,
        positions=positions,
        wrenches=wrenches,
        columns=columns,
    )
    table = ec.Campaign.from_table(nominal, measured)
    for name, values in vars(arrays.checked.measurements).items():
        np.testing.assert_array_equal(values, getattr(table.checked.measurements, name))


def test_poses_and_repeats_are_counted_where_no_column_numbers_them(nominal, measured):
    angles, positions = angles_and_positions(measured, nominal)
    campaign = ec.Campaign(nominal, joint_angles=angles, positions=positions)
    counted = campaign.checked.measurements
    assert len(np.unique(counted.pose)) == measured["pose"].nunique()
    assert counted.repeat.max() == measured["repeat"].max()


def shuffle_rows(*arrays):
    order = np.random.default_rng(6).permutation(len(arrays[0]))
    return [array[order] for array in arrays], order


def test_numbers_of_poses_and_loads_do_not_depend_on_the_order_of_rows(nominal):
    """Each pose has two loads and is approached twice, with a controller's jitter."""
    draws = np.random.default_rng(5)
    angles = np.repeat(draws.uniform(-1.0, 1.0, (20, nominal.joints)), 4, axis=0)
    angles += 1e-4 * draws.uniform(-1.0, 1.0, angles.shape)
    positions = draws.uniform(-1.0, 1.0, (len(angles), 3))
    wrenches = np.zeros((len(angles), 6))
    wrenches[::2, 2] = -100.0
    campaign = ec.Campaign(
        nominal, joint_angles=angles, positions=positions, wrenches=wrenches
    )
    shuffled, order = shuffle_rows(angles, positions, wrenches)
    names = ("joint_angles", "positions", "wrenches")
    again = ec.Campaign(nominal, **dict(zip(names, shuffled, strict=True)))
    numbers = campaign.checked.measurements
    for name in ("pose", "load", "repeat", "position"):
        expected = getattr(numbers, name)[order]
        np.testing.assert_array_equal(
            getattr(again.checked.measurements, name), expected
        )
    assert len(np.unique(numbers.pose)) == 20
    assert np.unique(numbers.load).tolist() == [0, 1]
    assert np.unique(numbers.repeat).tolist() == [0, 1]


def test_several_targets_make_a_row_each_but_for_missing_ones(nominal, measured):
    angles, positions = angles_and_positions(measured, nominal)
    two = np.stack([positions, positions + 0.05], axis=1)
    two[7, 1] = np.nan
    targets = {
        name: {"point": "tool", "offset_m": "unknown"} for name in ("left", "right")
    }
    campaign = ec.Campaign(nominal, joint_angles=angles, positions=two, targets=targets)
    assert len(campaign) == 2 * len(angles) - 1


def test_folder_is_read_with_a_robot_of_the_project(tmp_path, kuka):
    folder = make_folder(tmp_path, kuka)
    campaign = ec.read_campaign(folder, TOP / "config/robots")
    fitted, held_out = campaign.split()
    rows = [len(case.campaign.measurements) for case in (fitted, held_out)]
    assert sum(rows) == len(campaign)
    assert min(rows) > 0


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"joint_angles": np.zeros((40, 5))}, "joint_angles: found an array of shape"),
        ({"positions": np.zeros((3, 3))}, "positions: found an array of shape (3, 3)"),
        ({"wrenches": "heavy"}, "wrenches"),
        ({"frame": "moon"}, "frame"),
        ({"declared": ["magic"]}, "declared[0]: found 'magic'"),
        ({"remainder": "magic"}, "remainder: found 'magic'"),
        ({"columns": {"colour": np.zeros(60)}}, "columns: found 'colour'"),
        ({"no_such_key": 1}, "no_such_key"),
        (
            {"joint_angles": np.zeros((0, 6)), "positions": np.zeros((0, 3))},
            "positions",
        ),
        ({"positions": np.full((60, 3), np.nan)}, "found no measured position"),
    ],
)
def test_a_wrong_argument_is_named_in_one_line(nominal, measured, change, message):
    angles, positions = angles_and_positions(measured, nominal)
    arguments = {"joint_angles": angles, "positions": positions}
    if "columns" in change:
        change = {"columns": {"colour": np.zeros(len(angles))}}
    with pytest.raises(ec.InputError) as caught:
        ec.Campaign(nominal, **(arguments | change))
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("robot", ["arm.urdf", None])
def test_what_is_no_robot_makes_no_campaign(robot, measured):
    for make in (
        lambda: ec.Campaign(robot, joint_angles=[[0.0]], positions=[[0.0] * 3]),
        lambda: ec.Campaign.from_table(robot, measured),
    ):
        with pytest.raises(ec.InputError, match=r"robot: found .* allowed: a Robot"):
            make()


def test_a_force_along_one_axis_is_a_load(nominal, measured):
    """Columns of a load that the table lacks are zero; none is left out."""
    columns = [*(f"q{joint}" for joint in range(1, 7)), *"xyz"]
    table = measured[columns].assign(fz=-100.0)
    wrench = ec.Campaign.from_table(nominal, table).checked.measurements.wrench
    np.testing.assert_array_equal(wrench, [[0, 0, -100, 0, 0, 0]] * len(table))


def test_a_part_of_an_orientation_is_refused(nominal, measured):
    with pytest.raises(ec.InputError, match="table: found no column 'rx'"):
        ec.Campaign.from_table(nominal, measured.assign(ry=0.0))
    with pytest.raises(ec.InputError, match="a DataFrame of pandas"):
        ec.Campaign.from_table(nominal, {"q1": [0.0]})


def test_a_wrong_value_is_named_by_argument_and_row(nominal, measured):
    angles, positions = angles_and_positions(measured, nominal)
    angles[4, 2] = np.inf
    with pytest.raises(ec.InputError, match=r"row 5, column joint_angles\[2\]"):
        ec.Campaign(nominal, joint_angles=angles, positions=positions)
