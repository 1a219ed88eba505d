"""The page of an audit says first whether all holds."""

from elastocal_proof.audit.findings import Finding
from elastocal_proof.audit.page import kind_of, page
from elastocal_proof.audit.whole import as_table

GOOD = Finding("deviation", "pinocchio", 4, 1e-5, file="results/metrics/kuka/200um/6DoF.parquet")
BAD = Finding("column <dev>", "pandas", 2, 7.0, "found 1, expected 2", "reports/tables/table4.csv")


def test_a_run_without_fault_says_so():
    text = page(as_table([GOOD]), {"seed": "1"})
    assert "All 1 checks hold." in text
    assert "What does not hold" not in text


def test_what_does_not_hold_is_shown_and_nothing_of_it_is_run():
    text = page(as_table([GOOD, BAD]), {})
    assert "1 of 2 checks do not hold." in text
    assert "column &lt;dev&gt;" in text
    assert "http" not in text


def test_what_was_not_worked_out_again_is_named_apart():
    bytes_alone = Finding("bytes as its job wrote them", "hashlib, SHA-256", 1, 0.0, file="reports/figures/fig3.pdf")
    again, apart = page(as_table([GOOD, bytes_alone]), {}).split("What was not worked out again")
    assert "Equations 12 to 15 at sampled lengths" in again
    assert "reports/figures/*.pdf" in apart
    assert "reports/figures/*.pdf" not in again
    assert "In <strong>1 files</strong>" in again
    assert "What was not worked out again" not in page(as_table([GOOD]), {})


def test_columns_of_a_table_that_are_not_followed_are_named():
    followed = Finding("765 of 850 cells followed; not interpretation", "pandas", 0, 0.0, file="reports/tables/comparison.csv")
    text = page(as_table([GOOD, followed]), {})
    assert ">765<" in text
    assert ">interpretation<" in text


def test_files_that_are_made_alike_are_one_row():
    assert kind_of(GOOD.file) == "results/metrics/*/*um/*.parquet"
    assert kind_of("data/simulated/kuka/200um/measured.parquet") == "data/simulated/*/*um/measured.parquet"
    assert kind_of("results/loop/cell/models.parquet") == "results/loop/*/models.parquet"
    assert kind_of("reports/loop/campaigns.csv") == "reports/loop/campaigns.csv"
    assert kind_of("results/logs/audit.log") == "results/logs/*.log"
