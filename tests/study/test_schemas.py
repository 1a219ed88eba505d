"""Every quantity of the study's tables has a meaning, a unit and one name."""

import pytest

from elastocal.study.schemas import SCHEMAS

# Columns that are counts, names, shares or flags, and have no unit.
UNITS = {"", "m", "m^2", "rad", "N", "N m", "rad/(N m)", "percent", "m, rad"}


@pytest.mark.parametrize("name", SCHEMAS)
def test_every_column_has_a_meaning_and_a_unit_that_is_used_elsewhere(name):
    columns = SCHEMAS[name].columns
    assert len({column.name for column in columns}) == len(columns)
    for column in columns:
        assert column.meaning, column.name
        assert column.unit in UNITS, (column.name, column.unit)


def test_angles_have_a_column_for_each_joint():
    names = [column.name for column in SCHEMAS["experiments"].for_joints(7).columns]
    assert [name for name in names if name.startswith("q")] == [
        f"q{joint}" for joint in range(1, 8)
    ]
