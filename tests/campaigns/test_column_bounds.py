"""What no instrument reads is refused by row and column; what honest ones read is not."""

import pytest
from support import refused

from elastocal.campaigns.column_bounds import BOUNDS
from elastocal.campaigns.measurements import file_columns

IMPOSSIBLE = {
    **{"fx": [2e6, -1e9], "my": [1e8], "x": [1e9], "time_s": [1.6e11, -1e12], "u95_m": [0.0, -1e-5, 6e-12, 1e-300, 60.0, 0.2]},
    "temperature_c": [-500.0, -273.2, 293.15, 1e6],
}


def test_bounds_are_of_columns_that_a_file_may_have():
    assert set(BOUNDS) <= set(file_columns(6))
    assert all(bound.least < bound.largest for bound in BOUNDS.values())


@pytest.mark.parametrize(("column", "entry"), [(column, entry) for column, found in IMPOSSIBLE.items() for entry in found])
def test_what_physics_does_not_allow_is_refused_by_row_and_column(cell, column, entry):
    cell.table["u95_m"] = [1e-4] * len(cell.table["pose"])
    cell.spoil(14, column, entry)
    with refused(cell.measurements, f"row 14, column {column} (line 15)", BOUNDS[column].allowed):
        cell.read()
