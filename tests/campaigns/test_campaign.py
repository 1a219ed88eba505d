"""Measurements of a campaign, chosen by mask or index, and as columns of tables."""

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

PARTS = {
    "rotation_vector": ("rx", "ry", "rz"),
    "approach": ("approach1", "approach2", "approach3"),
    "time_s": ("time_s",),
    "temperature_c": ("temperature_c",),
    "u95_m": ("u95_m",),
}
PLAIN = (
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
    """No two columns are alike."""
    cell.table["u95_m"] = list(np.linspace(1e-4, 2e-4, len(cell.table["pose"])))
    return cell.read().measurements


def test_selected_measurements_come_in_the_order_of_the_index(measurements):
    measurements = replace(measurements, time_s=None)
    chosen = measurements.select(np.array([5, 2]))
    assert len(chosen) == 2 and chosen.row.tolist() == [6, 3] and chosen.time_s is None
    np.testing.assert_array_equal(chosen.position, measurements.position[[5, 2]])
    assert_same(
        measurements.select(measurements.load == 1),
        measurements.select(np.flatnonzero(measurements.load == 1)),
    )


def test_every_number_stands_in_the_column_of_its_name(cell, measurements):
    columns = tabulate_measurements(measurements)
    assert [*columns] == [*PLAIN, *(name for names in PARTS.values() for name in names)]
    for name in [*columns.keys() & cell.table.keys() - {"target"}]:
        np.testing.assert_array_equal(columns[name], cell.table[name], err_msg=name)
    assert_same(build_measurements(columns), measurements)


@pytest.mark.parametrize("part", PARTS)
def test_what_was_not_measured_is_an_empty_column_and_is_absent_again(
    measurements, part
):
    columns = tabulate_measurements(replace(measurements, **{part: None}))
    assert {name for name, values in columns.items() if np.isnan(values).any()} == set(
        PARTS[part]
    )
    assert [
        name
        for name, values in vars(build_measurements(columns)).items()
        if values is None
    ] == [part]


def test_residuals_of_poses_stand_beside_the_measurements_in_the_positions_that_are_given(
    measurements,
):
    some = measurements.select(np.array([3, 9]))
    before, after = (np.arange(12.0).reshape(2, 6) + start for start in (100.0, 200.0))
    position = np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]])
    beyond = np.array([False, True])
    columns = tabulate_residuals(
        some,
        beyond,
        position,
        {"before": before, "after": after[:, :3]},
        held_out=False,
        gross_errors=False,
    )
    for number, component in enumerate(("dx", "dy", "dz", "rx", "ry", "rz")):
        np.testing.assert_array_equal(columns[f"before_{component}"], before[:, number])
        np.testing.assert_array_equal(
            columns[f"after_{component}"],
            after[:, number] if number < 3 else [np.nan] * 2,
        )
    np.testing.assert_array_equal([columns[axis] for axis in "xyz"], position.T)
    whole = tabulate_measurements(some)
    assert all(
        (columns[name] == whole[name]).all() for name in ("row", "q2", "mz", "time_s")
    )
    assert columns["outside_range"].tolist() == [False, True]
    own = {
        "held_out",
        "gross_error",
        "outside_range",
        *(name for name in columns if name.startswith(("before", "after"))),
    }
    assert columns.keys() - own == {*PLAIN, "time_s"}


@given(
    st.lists(
        st.tuples(st.integers(-2, 2), st.integers(-2, 2), st.integers(0, 1)),
        min_size=1,
        max_size=30,
    )
)
@settings(max_examples=30)
def test_groups_are_those_of_numpy_unique(rows):
    keys = np.array(rows)
    _, expected_first, expected = np.unique(
        keys, axis=0, return_index=True, return_inverse=True
    )
    first, group = group_equal_rows(keys)
    np.testing.assert_array_equal(first, expected_first)
    np.testing.assert_array_equal(group, expected.ravel())
