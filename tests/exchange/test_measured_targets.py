"""Tables of corrected targets and of measurements there: contents, and every fault."""

import numpy as np
import pandas as pd
import pytest
from analysed_robots import analysed
from made_corrections import ANGLES, write_measured, write_targets

from elastocal.errors import InputError
from elastocal.exchange.measured_targets import (
    read_corrected_targets,
    read_target_measurements,
)

ROBOT = analysed("kuka")


def refuse(function, *arguments, **options):
    """Return the message with which a function refuses its input."""
    with pytest.raises(InputError) as error:
        function(*arguments, **options)
    return str(error.value)


@pytest.fixture
def paths(tmp_path):
    return tmp_path / "targets.csv", tmp_path / "measured.csv"


@pytest.fixture
def read(paths):
    """Reads the measurements of a campaign with these reflectors."""

    def read_both(*reflectors, **options):
        targets = read_corrected_targets(paths[0], 6)
        return read_target_measurements(
            paths[1], targets, ROBOT, reflectors or ("SMR",), **options
        )

    return read_both


def test_rows_without_a_correction_have_no_measurement(paths, read):
    status = ["ok"] * 8 + [
        "singular",
        "no bound: loads beyond 2 times the measured ones",
    ]
    table = write_targets(paths[0], status=status)
    table.loc[8, ANGLES] = np.nan
    table.loc[9, "predicted_bound_m"] = np.nan
    table.to_csv(paths[0], index=False)
    targets = read_corrected_targets(paths[0], 6)
    np.testing.assert_array_equal(targets.usable, [True] * 8 + [False, True])
    assert np.isnan(targets.bound_m[9]) and np.isnan(targets.joint_angles[8]).all()
    write_measured(paths[1], table.drop(index=8))
    np.testing.assert_array_equal(read().row, [0, 1, 2, 3, 4, 5, 6, 7, 9])
    write_measured(paths[1], table, pose=np.arange(1, 11))
    assert "a target that was corrected" in refuse(read)


def test_tables_of_other_programs_are_read_with_their_units(paths, read):
    table = write_targets(paths[0])
    position = 1e3 * table[["x", "y", "z"]].to_numpy()
    other = pd.DataFrame(position, columns=["X [mm]", "Y [mm]", "Z [mm]"])
    other["Point ID"] = [f"P{number}" for number in range(10)]
    other.to_csv(paths[1], index=False, sep=";")
    measured = read()
    np.testing.assert_allclose(measured.position, 1e-3 * position)
    other.columns = ["x", "y", "z", "name"]
    other.to_csv(paths[1], index=False)
    assert "metres" in refuse(read)
    np.testing.assert_allclose(read(lengths="mm").position, 1e-3 * position)


def test_names_of_targets_and_times_of_day_are_read_as_a_tracker_writes_them(
    paths, read
):
    table = write_targets(paths[0])
    names = [f"P{number:03}" for number in range(2, 11)]
    clock = [f"15:00:{second:02}" for second in range(9)]
    write_measured(paths[1], table[1:], pose=names, time=clock)
    measured = read()
    np.testing.assert_array_equal(measured.row, np.arange(1, 10))
    assert measured.conditions["time_s"][:2].tolist() == [54000.0, 54001.0]
    write_measured(paths[1], table[1:], pose=names, time="after lunch")
    assert not read().conditions


def test_repeats_are_counted_and_reflectors_told_apart(paths, read):
    table = write_targets(paths[0])
    twice = table.loc[np.repeat(np.arange(10), 2)]
    write_measured(paths[1], twice, pose=np.repeat(np.arange(10), 2) + 1)
    np.testing.assert_array_equal(read().repeat, np.tile([0, 1], 10))
    write_measured(paths[1], twice, target=["A", "B"] * 10)
    measured = read("A", "B")
    np.testing.assert_array_equal(measured.row, np.repeat(np.arange(10), 2))
    assert "a target of the campaign" in refuse(read, "A", "C")
    write_measured(paths[1], table)
    assert "no column 'target'" in refuse(read, "A", "B")


def test_orientations_time_and_temperature_are_kept(paths, read):
    table = write_targets(paths[0])
    vectors = {name: table[name] for name in ("rx", "ry", "rz")}
    write_measured(paths[1], table, **vectors, time_s=np.arange(10.0))
    measured = read()
    np.testing.assert_allclose(
        measured.rotation_vector, table[["rx", "ry", "rz"]].to_numpy()
    )
    np.testing.assert_array_equal(measured.conditions["time_s"], np.arange(10.0))


@pytest.mark.parametrize(
    ("columns", "fragment"),
    [
        ({"pose": 0}, "1 to 10"),
        ({"pose": 3, "repeat": 1}, "again"),
        (dict.fromkeys(ANGLES, 0.1), "the joint angle of this target"),
        ({"x": "lost"}, "'lost'"),
    ],
)
def test_measurements_of_no_target_are_refused(paths, read, columns, fragment):
    write_measured(paths[1], write_targets(paths[0]), **columns)
    assert fragment in refuse(read)


def test_as_many_measurements_as_targets_unless_they_have_numbers(paths, read):
    table = write_targets(paths[0])
    write_measured(paths[1], table[:-1])
    assert "no column 'pose'" in refuse(read)
    write_measured(paths[1], table[:-1], pose=np.arange(2, 11))
    np.testing.assert_array_equal(read().row, np.arange(1, 10))


def test_a_table_that_correct_did_not_write_is_refused(paths):
    assert "--targets" in refuse(read_corrected_targets, paths[0], 6)
    table = write_targets(paths[0])
    assert "no column 'q7'" in refuse(read_corrected_targets, paths[0], 7)
    table.assign(status="unreachable").to_csv(paths[0], index=False)
    assert "no corrected target" in refuse(read_corrected_targets, paths[0], 6)
