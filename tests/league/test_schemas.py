"""Tables of the league have columns with units and meanings."""

import pytest

from elastocal_proof.league import schemas


@pytest.mark.parametrize("schema", [schemas.FOLDS, schemas.MECHANISMS, schemas.ENTRIES])
def test_columns_are_named_once_and_say_what_they_are(schema):
    names = [column.name for column in schema.columns]
    assert len(set(names)) == len(names) and all(
        column.meaning for column in schema.columns
    )
