"""Times, temperatures and numbers as anybody writes them."""

from dataclasses import replace

import numpy as np
import pytest
from imported_tables import PLAIN, table
from support import refused

TIMES = {
    "2023-05-04 10:20:33|2023-05-04 10:21:33.5": [1683195633.0, 1683195693.5],
    "2023-05-04T12:20:33+02:00|2023-05-04T10:21:33+00:00": [1683195633.0, 1683195693.0],
    "2023/05/04 10:20:33|2023/05/04 10:21:33": [1683195633.0, 1683195693.0],
    "04.05.2023 10:20:33|05.05.2023 10:20:33": [1683195633.0, 1683282033.0],
    "27.11.2026 14:05|27.11.2026 14:06": [1795788300.0, 1795788360.0],
    "27.11.26 14:05:01.5|27.11.26 14:06:00.0": [1795788301.5, 1795788360.0],
    "11/27/2026 2:05 PM|11/27/2026 2:06 PM": [1795788300.0, 1795788360.0],
    "05/12/2026 14:05|27/11/2026 14:05": [1796479500.0, 1795788300.0],
    "10:20:33|10:21:33": [37233.0, 37293.0],
    "23:59|00:01": [86340.0, 86460.0],
    "11:59:00 AM|01:00:00 PM": [43140.0, 46800.0],
    "1600000000000|1600000002000": [1.6e9, 1600000002.0],
    "1600000000000000|1600000002000000": [1.6e9, 1600000002.0],
    "1600000000000000000|1600000002000000000": [1.6e9, 1600000002.0],
    "1600000000.0|1600000002.0": [1.6e9, 1600000002.0],
    "0.5|2": [0.5, 2.0],
}


@pytest.mark.parametrize("cells", TIMES)
@pytest.mark.parametrize("header", ["Time", "Timestamp", "%time", "__time", "/header/Time"])
def test_time_is_read_as_anybody_writes_it(tmp_path, cells, header):
    rows = "".join(f"{number},1,2,3,{cell}\n" for number, cell in enumerate(cells.split("|")))
    found = table(tmp_path, f"q1,x,y,z,{header}\n{rows}")
    if header == "/header/Time":
        assert "time_s" not in found.table and header in found.ignored
        return
    np.testing.assert_allclose(found.table["time_s"], TIMES[cells], rtol=0, atol=1e-6)
    again = table(tmp_path, f"q1,x,y,z,{header}\n{rows}", found.options)
    np.testing.assert_array_equal(again.table["time_s"], found.table["time_s"])


def test_of_two_days_that_a_date_may_be_the_one_is_read_that_an_option_says(tmp_path):
    text = "q1,x,y,z,Time\n0,1,2,3,05/04/2023 10:20\n1,1,2,3,06/04/2023 10:20\n"
    with refused(tmp_path / "t.csv", "line 2, column Time", "'05/04/2023 10:20'", "--unit time_s=day-first or month-first"):
        table(tmp_path, text)
    for order, days in (("day-first", 1), ("month-first", 31)):
        found = table(tmp_path, text, replace(PLAIN, units=PLAIN.units | {"time_s": order}))
        assert np.diff(found.table["time_s"]) == 86400.0 * days
        assert (table(tmp_path, text, found.options).table["time_s"] == found.table["time_s"]).all()


@pytest.mark.parametrize(
    ("header", "cells"),
    [
        ("Time", ["10:20:33", "noon"]),
        ("Time", ["10:20:33", "2023-05-04 10:20:33"]),
        ("Temp", ["21.3 C", "21.3 C"]),
        ("Temperature", ["21.3", ""]),
    ],
)
def test_time_or_temperature_that_is_no_number_is_left_out_with_a_note_but_not_where_it_is_asked_for(tmp_path, header, cells):
    text = f"q1,x,y,z,{header}\n" + "".join(f"{number},1,2,3,{cell}\n" for number, cell in enumerate(cells))
    found = table(tmp_path, text)
    name = "time_s" if header == "Time" else "temperature_c"
    assert name not in found.table and found.ignored == (header,)
    assert len(found.notes) == 1 and header in found.notes[0] and "not read" in found.notes[0]
    assert table(tmp_path, text, replace(PLAIN, ignore=[header])).notes == ()
    with refused(tmp_path / "t.csv", f"column {header}", f"--ignore {header!r}"):
        table(tmp_path, text, replace(PLAIN, columns={name: header}))
