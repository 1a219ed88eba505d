"""Measurements of a campaign are selected by mask or index, and written as columns of
tables."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from made_cells import assert_same

from elastocal.campaigns.campaign import (
    build_measurements,
    group_equal_rows,
    tabulate_measurements,
    tabulate_residuals,
)

# Optional arrays of measurements, with their columns.
OPTIONAL_COLUMNS = {
    "rotation_vector": ("rx", "ry", "rz"),
    "approach": ("approach1", "approach2", "approach3"),
    "time_s": ("time_s",),
    "temperature_c": ("temperature_c",),
    "u95_m": ("u95_m",),
}
# Columns of campaigns with several kinds of measurement alone.
COLUMNS_OF_KINDS = ("channel", "spread")
REQUIRED_COLUMNS = (
    "session",
    "pose",
    "load",
    "repeat",
    "target",
    "row",
    "q1",
    "q2",
    "q3",
    "fx",
    "fy",
    "fz",
    "mx",
    "my",
    "mz",
    *"xyz",
)


@pytest.fixture
def measurements(cell):
    """Measurements of which no two columns are equal."""
    cell.table["u95_m"] = list(np.linspace(1e-4, 2e-4, len(cell.table["pose"])))
    return cell.read().measurements


def test_selected_measurements_come_in_the_order_of_the_index(measurements):
    measurements = replace(measurements, time_s=None)
    selected = measurements.select(np.array([5, 2]))
    assert len(selected) == 2
    assert selected.row.tolist() == [6, 3]
    assert selected.time_s is None
    np.testing.assert_array_equal(selected.position, measurements.position[[5, 2]])
    assert_same(
        measurements.select(measurements.load == 1),
        measurements.select(np.flatnonzero(measurements.load == 1)),
    )


def test_every_number_is_in_the_column_of_its_name(cell, measurements):
    columns = tabulate_measurements(measurements)
    optional = [name for names in OPTIONAL_COLUMNS.values() for name in names]
    assert [*columns] == [*REQUIRED_COLUMNS, *optional, *COLUMNS_OF_KINDS]
    for name in [*columns.keys() & cell.table.keys() - {"target"}]:
        np.testing.assert_array_equal(columns[name], cell.table[name], err_msg=name)
    assert_same(build_measurements(columns), measurements)


@pytest.mark.parametrize("array", OPTIONAL_COLUMNS)
def test_an_array_that_was_not_measured_is_written_as_empty_columns(
    measurements, array
):
    columns = tabulate_measurements(replace(measurements, **{array: None}))
    empty = {name for name, values in columns.items() if np.isnan(values).any()}
    assert empty == {*OPTIONAL_COLUMNS[array], *COLUMNS_OF_KINDS}
    read_back = vars(build_measurements(columns))
    missing = [name for name, values in read_back.items() if values is None]
    assert missing == [array, *COLUMNS_OF_KINDS]


def test_residuals_are_written_next_to_the_measurements_at_the_given_positions(
    measurements,
):
    selected = measurements.select(np.array([3, 9]))
    before = np.arange(12.0).reshape(2, 6) + 100.0
    after = np.arange(12.0).reshape(2, 6) + 200.0
    position = np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]])
    is_beyond = np.array([False, True])
    columns = tabulate_residuals(
        selected,
        is_beyond,
        position,
        {"before": before, "after": after[:, :3]},
        held_out=False,
        gross_errors=False,
    )
    expected_after = np.column_stack([after[:, :3], np.full((2, 3), np.nan)])
    for number, component in enumerate(("dx", "dy", "dz", "rx", "ry", "rz")):
        np.testing.assert_array_equal(columns[f"before_{component}"], before[:, number])
        np.testing.assert_array_equal(
            columns[f"after_{component}"], expected_after[:, number]
        )
    np.testing.assert_array_equal([columns[axis] for axis in "xyz"], position.T)
    expected = tabulate_measurements(selected)
    for name in ("row", "q2", "mz", "time_s"):
        assert (columns[name] == expected[name]).all()
    assert columns["outside_range"].tolist() == [False, True]
    of_residuals = {
        name for name in columns if name.startswith(("before", "after"))
    } | {"held_out", "gross_error", "outside_range"}
    assert columns.keys() - of_residuals == {*REQUIRED_COLUMNS, "time_s"}


@given(
    st.lists(
        st.tuples(st.integers(-2, 2), st.integers(-2, 2), st.integers(0, 1)),
        min_size=1,
        max_size=30,
    )
)
@settings(max_examples=30)
def test_equal_rows_are_grouped_as_by_numpy_unique(rows):
    keys = np.array(rows)
    _, expected_first, expected = np.unique(
        keys, axis=0, return_index=True, return_inverse=True
    )
    first, group = group_equal_rows(keys)
    np.testing.assert_array_equal(first, expected_first)
    np.testing.assert_array_equal(group, expected.ravel())
