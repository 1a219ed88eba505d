"""How the study declares its tables, and the columns that several have: name, type, unit, meaning."""

from elastocal.io.storage import Column, TableSchema


def table(name: str, *columns: Column) -> TableSchema:
    """A table: its name and its columns with units and meanings, written down beside the function that fills it."""
    return TableSchema(name, columns)


def real(name: str, unit: str, meaning: str, missing: bool = False, minimum: float | None = None) -> Column:
    """Numbers; `missing`: some may be not a number or infinite."""
    return Column(name, "float64", unit, meaning, missing, minimum)


def whole(name: str, meaning: str, minimum: int | None = None) -> Column:
    """Counts and numbers of things."""
    return Column(name, "int32", "", meaning, minimum=minimum)


def group(name: str, meaning: str) -> Column:
    """A word that is the same in a whole row group."""
    return Column(name, "string", "", meaning)


def text(name: str, meaning: str) -> Column:
    """A word of its own in each row."""
    return Column(name, "text", "", meaning)


SET = whole("data_set", "number of the data set, from 0", 0)
CONFIGURATION = whole("configuration", "number of the configuration in its data set, from 0", 0)
LENGTH = whole("length", "data set length ds: how many configurations, from the first, were used", 1)
STRATEGY = group("strategy", "name of the strategy; a row group holds one")
ON_TESTS = "mean square end-effector error on test configurations"
ERROR = real("mean_square", "m^2", ON_TESTS, missing=True)
