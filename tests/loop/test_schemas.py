"""Columns of the loop's tables: their names, their units, and what may be missing in them."""

import numpy as np
import pytest
from made_loop_tables import residual_table
from support import refused

from elastocal.io.storage import TableSchema, read_table, write_table
from elastocal.loop import schemas

FIXED = [value for value in vars(schemas).values() if isinstance(value, TableSchema)]
OF_JOINTS = (schemas.measurements, schemas.residuals)


@pytest.mark.parametrize("schema", [*FIXED, *(of(7) for of in OF_JOINTS)], ids=lambda schema: schema.name)
def test_no_table_has_two_columns_of_one_name_and_each_says_what_it_holds(schema):
    names = [column.name for column in schema.columns]
    assert len(set(names)) == len(names)
    assert all(column.meaning.strip() for column in schema.columns)


def test_a_made_table_of_residuals_fits_its_schema_and_a_position_that_is_missing_is_refused(tmp_path):
    table = residual_table(poses=3, timed=False)
    write_table(tmp_path / "r.parquet", schemas.residuals(6), [table], {})
    back = read_table(tmp_path / "r.parquet", schemas.residuals(6))
    np.testing.assert_array_equal(back["before_dz"], table["before_dz"])
    assert np.isnan(back["time_s"]).all()
    with refused(tmp_path / "w.parquet", "column x, "):
        write_table(tmp_path / "w.parquet", schemas.residuals(6), [table | {"x": np.full(len(table["x"]), np.nan)}], {})


def test_gross_errors_are_left_out(tmp_path):
    schema = schemas.residuals(6)
    columns = {column.name: np.ones(3, column.type) for column in schema.columns}
    columns |= {"row": np.array([1, 2, 3], np.int32), "gross_error": np.array([False, True, False])}
    write_table(tmp_path / "residuals.parquet", schema, [columns], {})
    assert schemas.read_residuals(tmp_path / "residuals.parquet", 6)["row"].tolist() == [1, 3]
