"""Tables of other programs, imported as tests write them."""

from elastocal.exchange.import_options import ImportOptions
from elastocal.exchange.measurement_table import read_measurement_table

PLAIN = ImportOptions(units={"angles": "deg", "lengths": "mm"}, target="smr")
ROW = "1,2,3"
UR5E = """joint, theta_offset_deg, d_m,    a_m,     alpha_deg, type
1,     0,                0.1625, 0,       90,        R
2,     0,                0,      -0.425,  0,         R
3,     0,                0,      -0.3922, 0,         R
4,     0,                0.1333, 0,       90,        R
5,     0,                0.0997, 0,       -90,       R
6,     0,                0.0996, 0,       0,         R
"""


def table(folder, text, options=PLAIN, robot=None):
    """What a text is read as."""
    (folder / "t.csv").write_text(text)
    return read_measurement_table(folder / "t.csv", options, robot)
