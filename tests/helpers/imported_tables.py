"""Tables of other programs, imported as tests write them."""

from elastocal.exchange.measurement_table import ImportOptions, read_measurement_table

PLAIN = ImportOptions(units={"angles": "deg", "lengths": "mm"}, target="smr")
ROW = "1,2,3"


def table(folder, text, options=PLAIN, robot=None):
    """What a text is read as."""
    (folder / "t.csv").write_text(text)
    return read_measurement_table(folder / "t.csv", options, robot)
