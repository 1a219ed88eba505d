"""Tables of the closed loop have columns with units and meanings, and an audit knows them."""

from elastocal_proof.audit.schemas import SCHEMAS
from elastocal_proof.blind import schemas


def test_columns_are_named_once_and_say_what_they_are():
    table = schemas.closed_loop(7)
    names = [column.name for column in table.columns]
    assert len(set(names)) == len(names) and all(column.meaning for column in table.columns)
    assert [name for name in names if name[0] == "q"] == [f"q{joint}" for joint in range(1, 8)]


def test_an_audit_knows_the_table_by_the_name_that_its_file_states():
    assert SCHEMAS[schemas.closed_loop(6).name](6) == schemas.closed_loop(6)


def test_an_audit_knows_the_table_of_bad_rows():
    assert SCHEMAS["bad_rows"](6) == schemas.BAD_ROWS
    assert all(column.meaning for column in schemas.BAD_ROWS.columns)
