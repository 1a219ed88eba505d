"""Tables of the loop say what each column holds, and residuals are read without gross
errors."""

import numpy as np

from elastocal.io.storage import write_table
from elastocal.loop import schemas


def test_columns_have_names_of_their_own_and_a_meaning_and_gross_errors_are_left_out(
    tmp_path,
):
    for schema in (
        schemas.STEPS,
        schemas.build_measurements_schema(7),
        schemas.build_residuals_schema(7),
    ):
        assert len({column.name for column in schema.columns}) == len(schema.columns)
        assert all(column.meaning.strip() for column in schema.columns)
    columns = {
        column.name: np.ones(3, column.type)
        for column in schemas.build_residuals_schema(6).columns
    }
    columns |= {
        "row": np.array([1, 2, 3], np.int32),
        "gross_error": np.array([False, True, False]),
    }
    write_table(
        tmp_path / "residuals.parquet", schemas.build_residuals_schema(6), [columns], {}
    )
    assert schemas.read_residuals(tmp_path / "residuals.parquet", 6)[
        "row"
    ].tolist() == [1, 3]
