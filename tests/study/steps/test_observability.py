"""Observability of few data sets beside what they are worth."""

from made_studies import few_of

from elastocal.study.steps.observability import observability_columns


def test_observability_stands_beside_bound_and_error_of_the_same_data_set(kuka):
    table = observability_columns(few_of(kuka))
    assert {"data_set", "O1", "O5", "bound", "mean_square"} <= set(table)
    assert (table["bound"] > 0).all() and 0.1 < table["mean_square"].mean() / table["bound"].mean() < 4
