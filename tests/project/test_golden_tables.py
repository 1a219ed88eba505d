"""Tables of the proofs from documents that never change: what they were when a second implementation agreed in every cell.

Where a table is meant to change, write it anew: `GOLDEN=write python -m pytest tests/project/test_golden_tables.py`.
"""

import os
from pathlib import Path

import pandas as pd
import pytest
from made_proofs import made_proofs

GOLDEN = Path(__file__).resolve().parents[1] / "golden"
NAMES = [
    *(f"blind/{name}" for name in ("cases", "intervals", "rates", "reliability", "summary")),
    *("closed_loop/cases", "closed_loop/closed_loop", "closed_loop/goals"),
    *("league/small/league", "league/small/mechanisms"),
]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    top = tmp_path_factory.mktemp("golden")
    made_proofs(top)
    return top / "reports"


@pytest.mark.parametrize("name", NAMES)
def test_a_table_is_what_it_was(name, folder):
    kept = GOLDEN / f"{name.replace('/', '_')}.csv"
    if os.environ.get("GOLDEN") == "write":
        kept.parent.mkdir(exist_ok=True)
        kept.write_bytes((folder / f"{name}.csv").read_bytes())
    pd.testing.assert_frame_equal(pd.read_csv(folder / f"{name}.csv"), pd.read_csv(kept), rtol=1e-7, atol=1e-12)
