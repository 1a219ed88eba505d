"""Tables of other programs, written and imported by tests."""

from elastocal.exchange.measurement_table import ImportOptions, read_measurement_table

PLAIN = ImportOptions(units={"angles": "deg", "lengths": "mm"}, target="smr")
ROW = "1,2,3"


def table(folder, text, options=PLAIN, robot=None):
    """Write a text to a file, and import it."""
    (folder / "t.csv").write_text(text)
    return read_measurement_table(folder / "t.csv", options, robot)
