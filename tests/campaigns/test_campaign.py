"""Measurements of a campaign, chosen by mask or index."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from made_cells import assert_same

from elastocal.campaigns.campaign import Measurements, columns_of, groups_of, measurements_from, residual_columns


def test_selected_measurements_come_in_the_order_of_the_index(cell):
    measurements = replace(cell.read().measurements, time_s=None)
    chosen = measurements.select(np.array([5, 2]))
    assert len(chosen) == 2 and chosen.row.tolist() == [6, 3] and chosen.time_s is None
    np.testing.assert_array_equal(chosen.position, measurements.position[[5, 2]])
    assert_same(measurements.select(measurements.load == 1), measurements.select(np.flatnonzero(measurements.load == 1)))


def two_measurements(**others):
    """Of a robot with two joints; no two numbers are alike."""
    parts = {
        "session": [0, 1],
        "pose": [2, 3],
        "load": [4, 5],
        "repeat": [6, 7],
        "target": [8, 9],
        "joint_angles": [[0.1, 0.2], [0.3, 0.4]],
        "wrench": [[11, 12, 13, 14, 15, 16], [21, 22, 23, 24, 25, 26]],
        "position": [[31, 32, 33], [41, 42, 43]],
        "rotation_vector": [[51, 52, 53], [61, 62, 63]],
        "approach": [[1, -1], [0, 1]],
        "time_s": [71, 81],
        "temperature_c": [72, 82],
        "u95_m": [73, 83],
        "row": [91, 92],
    }
    return Measurements(**{name: None if v is None else np.array(v) for name, v in (parts | others).items()})


def list_values(columns):
    return {name: np.asarray(values).tolist() for name, values in columns.items()}


def test_every_number_stands_in_the_column_of_its_name():
    identity = {"session": [0, 1], "pose": [2, 3], "load": [4, 5], "repeat": [6, 7], "target": [8, 9], "row": [91, 92]}
    expected = identity | {"q1": [0.1, 0.3], "q2": [0.2, 0.4]}
    expected |= {"fx": [11, 21], "fy": [12, 22], "fz": [13, 23], "mx": [14, 24], "my": [15, 25], "mz": [16, 26]}
    expected |= {"x": [31, 41], "y": [32, 42], "z": [33, 43], "rx": [51, 61], "ry": [52, 62], "rz": [53, 63]}
    expected |= {"approach1": [1, 0], "approach2": [-1, 1], "time_s": [71, 81], "temperature_c": [72, 82], "u95_m": [73, 83]}
    assert list_values(columns_of(two_measurements())) == expected


ABSENT = {
    "rotation_vector": ("rx", "ry", "rz"),
    "approach": ("approach1", "approach2"),
    "time_s": ("time_s",),
    "temperature_c": ("temperature_c",),
}


@pytest.mark.parametrize("name", ABSENT)
def test_what_was_not_measured_is_an_empty_column_and_is_absent_again(name):
    columns = columns_of(two_measurements(**{name: None}))
    assert {column for column, values in columns.items() if np.isnan(values).any()} == set(ABSENT[name])
    back = measurements_from(columns)
    assert [part for part, values in vars(back).items() if values is None] == [name]


def test_residuals_of_poses_stand_beside_the_measurements_in_the_positions_that_are_given():
    before, after = (np.arange(12.0).reshape(2, 6) + start for start in (100.0, 200.0))
    position, beyond = np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]), np.array([False, True])
    stages = {"before": before, "after": after[:, :3]}
    columns = list_values(residual_columns(two_measurements(), False, False, beyond, position, stages))
    for number, component in enumerate(("dx", "dy", "dz", "rx", "ry", "rz")):
        assert columns[f"before_{component}"] == [100.0 + number, 106.0 + number]
        np.testing.assert_array_equal(
            columns[f"after_{component}"], [200.0 + number, 206.0 + number] if number < 3 else [np.nan] * 2
        )
    assert (columns["x"], columns["y"], columns["z"]) == ([1.0, 4.0], [2.0, 5.0], [3.0, 6.0])
    assert (columns["row"], columns["q2"], columns["mz"], columns["time_s"]) == ([91, 92], [0.2, 0.4], [16, 26], [71, 81])
    assert columns["outside_range"] == [False, True]


@given(st.lists(st.tuples(st.integers(-2, 2), st.integers(-2, 2), st.integers(0, 1)), min_size=1, max_size=30))
@settings(max_examples=30)
def test_groups_are_those_of_numpy_unique(rows):
    keys = np.array(rows)
    _, expected_first, expected = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    first, group = groups_of(keys)
    np.testing.assert_array_equal(first, expected_first)
    np.testing.assert_array_equal(group, expected.ravel())
