"""Tables of the proofs from documents that never change: what they were when a second implementation agreed in every cell.

Where a table is meant to change, write it anew: `GOLDEN=write python -m pytest tests/project/test_golden_tables.py`.
"""

import os
from pathlib import Path

import pandas as pd
import pytest
from made_proofs import made_tables

from elastocal.io.data_frames import write_csv

GOLDEN = Path(__file__).resolve().parents[1] / "golden"
NAMES = sorted(path.stem for of in ("blind", "closed_loop", "league") for path in GOLDEN.glob(f"{of}_*.csv"))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    place = GOLDEN if os.environ.get("GOLDEN") == "write" else tmp_path_factory.mktemp("golden")
    for name, table in made_tables().items():
        write_csv(place / f"{name}.csv", table)
    return place


def test_every_table_is_kept(folder):
    assert {f"{name}.csv" for name in NAMES} >= {path.name for path in folder.glob("[bcl]*.csv")} and len(NAMES) == 10


@pytest.mark.parametrize("name", NAMES)
def test_a_table_is_what_it_was(name, folder):
    pd.testing.assert_frame_equal(
        pd.read_csv(folder / f"{name}.csv"), pd.read_csv(GOLDEN / f"{name}.csv"), rtol=1e-7, atol=1e-12
    )
