"""Tables of the closed loop and of bad rows have columns with units and meanings."""

from elastocal_proof.blind import schemas


def test_columns_are_named_once_and_say_what_they_are():
    names = [
        column.name
        for column in schemas.build_closed_loop_schema(7).columns
        if column.meaning
    ]
    assert (
        len(set(names))
        == len(schemas.build_closed_loop_schema(7).columns)
        == len(names)
    )
    assert [name for name in names if name[0] == "q"] == [f"q{j}" for j in range(1, 8)]
