"""How tables are declared."""

from elastocal.study.columns import ERROR, SET, group, real, table, text, whole


def test_a_declaration_says_what_may_be_missing_and_what_stands_once_in_a_row_group():
    columns = group("point", "a word"), text("side", "a word"), whole("n", "a count", 1), real("x", "m", "a size")
    made = table("made", SET, *columns)
    assert [(column.name, column.type) for column in made.columns] == [
        *(("data_set", "int32"), ("point", "string"), ("side", "text"), ("n", "int32"), ("x", "float64"))
    ]
    assert not made.column("x").missing and ERROR.missing and ERROR.unit == "m^2" and made.column("n").minimum == 1
