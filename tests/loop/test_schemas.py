"""Columns of the loop's tables: their names, their units, and what may be missing in them."""

import numpy as np
import pytest

from elastocal.io.storage import TableSchema, write_table
from elastocal.loop import schemas

FIXED = [value for value in vars(schemas).values() if isinstance(value, TableSchema)]
OF_JOINTS = (schemas.measurements, schemas.residuals)


@pytest.mark.parametrize("schema", [*FIXED, *(of(7) for of in OF_JOINTS)], ids=lambda schema: schema.name)
def test_no_table_has_two_columns_of_one_name_and_each_says_what_it_holds(schema):
    names = [column.name for column in schema.columns]
    assert len(set(names)) == len(names)
    assert all(column.meaning.strip() for column in schema.columns)


def test_gross_errors_are_left_out(tmp_path):
    schema = schemas.residuals(6)
    columns = {column.name: np.ones(3, column.type) for column in schema.columns}
    columns |= {"row": np.array([1, 2, 3], np.int32), "gross_error": np.array([False, True, False])}
    write_table(tmp_path / "residuals.parquet", schema, [columns], {})
    assert schemas.read_residuals(tmp_path / "residuals.parquet", 6)["row"].tolist() == [1, 3]
