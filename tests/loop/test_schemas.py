"""The columns of the loop's tables have unique names and meanings, and residuals are
read without gross errors."""

import numpy as np

from elastocal.io.storage import write_table
from elastocal.loop import schemas


def test_columns_have_unique_names_and_a_meaning():
    for schema in (
        schemas.STEPS,
        schemas.MEASUREMENTS.for_joints(7),
        schemas.RESIDUALS.for_joints(7),
    ):
        assert len({column.name for column in schema.columns}) == len(schema.columns)
        assert all(column.meaning.strip() for column in schema.columns)


def test_residuals_are_read_without_gross_errors(tmp_path):
    columns = {
        column.name: np.ones(3, column.type)
        for column in schemas.RESIDUALS.for_joints(6).columns
    }
    columns |= {
        "row": np.array([1, 2, 3], np.int32),
        "gross_error": np.array([False, True, False]),
    }
    write_table(
        tmp_path / "residuals.parquet", schemas.RESIDUALS.for_joints(6), [columns], {}
    )
    assert schemas.read_residuals(tmp_path / "residuals.parquet", 6)[
        "row"
    ].tolist() == [1, 3]
