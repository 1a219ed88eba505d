"""Tables of the benchmark have columns with units and meanings."""

import pytest

from elastocal_proof.league import schemas


@pytest.mark.parametrize("schema", [schemas.FOLDS, schemas.MECHANISMS, schemas.ENTRIES])
def test_columns_have_unique_names_and_a_meaning(schema):
    names = [column.name for column in schema.columns]
    assert len(set(names)) == len(names)
    assert all(column.meaning for column in schema.columns)
