"""Times of day count through midnight."""

import numpy as np
import pytest
from imported_tables import PLAIN, table
from support import refused


def read(folder, *times):
    rows = "".join(f"{number};1;2;3;{time}\n" for number, time in enumerate(times))
    return table(folder, f"q1;x;y;z;time\n{rows}")


@pytest.mark.parametrize(
    ("times", "seconds"),
    [
        (["09:14", "09:15"], [33240.0, 33300.0]),
        (["9:14:22", "09:14:22.5"], [33262.0, 33262.5]),
        (["23:59:59", "00:00:01", "00:00:02"], [86399.0, 86401.0, 86402.0]),
        # A clock that was set back by an hour stays so.
        (["10:30:00", "09:30:00"], [37800.0, 34200.0]),
    ],
)
def test_times_of_day_are_seconds_since_the_first_midnight(tmp_path, times, seconds):
    np.testing.assert_allclose(read(tmp_path, *times).table["time_s"], seconds)


def test_other_texts_are_left_out_with_a_note(tmp_path):
    imported = read(tmp_path, "09:14:22", "25:14:22")
    assert "time_s" not in imported.table and "'time' not read" in imported.notes[0]
    with refused(tmp_path / "t.csv", "line 3", "times as 10:20:33"):
        table(
            tmp_path,
            "q1;x;y;z;T\n1;1;2;3;09:14:22\n1;1;2;3;noon\n",
            PLAIN.__class__(units=PLAIN.units, target="a", columns={"time_s": "T"}),
        )
