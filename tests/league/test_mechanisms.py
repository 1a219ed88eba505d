"""Where the data are at fault there are no mechanisms."""

from types import SimpleNamespace

from elastocal_proof.league.mechanisms import mechanism_columns
from elastocal_proof.league.schemas import MECHANISMS


def test_a_fold_without_evidence_has_no_rows():
    columns = mechanism_columns(SimpleNamespace(evidence=None), 1)
    assert list(columns) == [column.name for column in MECHANISMS.columns]
    assert all(len(values) == 0 for values in columns.values())
