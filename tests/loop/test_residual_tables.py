"""What states or draws errors reads the residuals without the gross errors."""

import numpy as np

from elastocal.io.storage import write_table
from elastocal.loop.residual_tables import read_residuals
from elastocal.loop.schemas import residuals


def test_gross_errors_are_left_out(tmp_path):
    schema = residuals(6)
    columns = {column.name: np.ones(3, column.type) for column in schema.columns}
    columns |= {"row": np.array([1, 2, 3], np.int32), "gross_error": np.array([False, True, False])}
    write_table(tmp_path / "residuals.parquet", schema, [columns], {})
    assert read_residuals(tmp_path / "residuals.parquet", 6)["row"].tolist() == [1, 3]
