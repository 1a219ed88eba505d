"""Tables of the league have columns with units and meanings."""

import pytest

from elastocal_proof.league import schemas
from elastocal_proof.league.folds import BLOCKS, RANDOM


@pytest.mark.parametrize("schema", [schemas.FOLDS, schemas.FITS, schemas.MECHANISMS, schemas.ENTRIES])
def test_columns_are_named_once_and_say_what_they_are(schema):
    names = [column.name for column in schema.columns]
    assert len(set(names)) == len(names) and all(column.meaning for column in schema.columns)


def test_each_split_of_one_data_set_has_its_folds():
    assert {RANDOM, BLOCKS} <= {column.name for column in schemas.FOLDS.columns}
