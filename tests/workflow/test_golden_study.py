"""Tables of the small study, which never change: what they were when a second implementation agreed in every cell.

Where a table is meant to change, copy it from a run of the small study; where one goes, delete its golden file.
"""

from pathlib import Path

import pandas as pd
import pytest

pytestmark = pytest.mark.slow
GOLDEN = sorted((Path(__file__).resolve().parents[1] / "golden").glob("study_*.csv"))


@pytest.mark.parametrize("kept", GOLDEN, ids=lambda path: path.stem)
def test_a_table_of_the_study_is_what_it_was(kept, small_study):
    made = small_study.path(f"reports/tables/{kept.name.removeprefix('study_')}")
    pd.testing.assert_frame_equal(pd.read_csv(made), pd.read_csv(kept), rtol=1e-7, atol=1e-12)


def test_the_tables_of_the_paper_are_among_them():
    assert {f"study_table{number}" for number in range(1, 5)} <= {path.stem for path in GOLDEN}
