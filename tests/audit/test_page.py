"""The page of an audit says first whether all holds."""

from elastocal.audit.findings import Finding
from elastocal.audit.page import kind_of, page
from elastocal.audit.whole import as_table

GOOD = Finding("results/metrics/kuka/200um/6DoF.parquet", "deviation", "pinocchio", 4, 1e-5)
BAD = Finding("reports/tables/table4.csv", "column <dev>", "pandas", 2, 7.0, "found 1, expected 2")


def test_a_run_without_fault_says_so():
    text = page(as_table([GOOD]), {"seed": "1"})
    assert "All 1 checks hold." in text
    assert "What does not hold" not in text


def test_what_does_not_hold_is_shown_and_nothing_of_it_is_run():
    text = page(as_table([GOOD, BAD]), {})
    assert "1 of 2 checks do not hold." in text
    assert "column &lt;dev&gt;" in text
    assert "http" not in text


def test_files_that_are_made_alike_are_one_row():
    assert kind_of(GOOD.file) == "results/metrics/*.parquet"
    assert kind_of("data/simulated/kuka/200um/measured.parquet") == "data/simulated/*/measured.parquet"
    assert kind_of("results/loop/cell/models.parquet") == "results/loop/*/models.parquet"
