"""What the report of the study states follows from its tables, with errors and intervals; the report and its page show it."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from drawn_figures import empty_pictures
from made_study_tables import comparison, facts

from elastocal.report.typesetting import compile_document, template

EVERY = facts()
FIGURES = ["figure2", "figure3", "figure4", "figure5a", "figure5c", "scores_against_paper", "ladder", "designs", "costs"]
BIBLIOGRAPHY = Path(__file__).resolve().parents[2] / "paper" / "paper.bib"
HEAD = {
    "table1": ["robot", "c1"],
    "table2": ["robot", "mean mm"],
    "table3": ["robot", "c1"],
    "table4": [f"n {k}" for k in range(8)],
    "interpretations": ["number", "open", "interpretation", "chosen on"],
}
# First rows of tables, in words.
ROWS = {
    "outside": ["Table 4: k_Σ at 20 (%)", "Kuka", "6DoF", "1.5", "1.75 ± 0.10", "0.0004", "0.002"],
    "one_set": ["Kuka", "mean", "1.100", "1.000", "1.05 ± 0.05", "0.31"],
    "joint": ["fixed joints", "60", "2", "9", "3 (to 7)", "0.06", "171", "120 (to 218)", "0.12"],
    "table4": ["Kuka", "6DoF", "4.00 ± 0.40", "2.00 ± 0.40", "80 ± 20", "80 ± 20", "8.00 ± 0.80", "90 ± 9"],
    "over_studies": ["Kuka", "8.00 ± 0.80", "80.0 ± 1.0", "10.0", "4.00", "2.00 ± 0.80"],
    "break_even": ["Kuka", "3+6DoF", "18.2", "31.7", "0.35 (0.20 to never)"],
    "budget": ["Kuka", "6DoF", "79.00 ± 0.50", "40", "52.00 ± 0.50", ""],
    "needed": ["Kuka", "6DoF", "32 (30 to 34)", "32", "32"],
    "ladder": ["200", "20", "40.00 ± 0.50", "20.00 ± 0.40", "1", "22.00 ± 0.50"],
    "smallest": ["Kuka", "20", "37.70 ± 0.80"],
    "simulated": ["Kuka", "random", "none", "62.00 ± 0.80"],
    "scores": ["Kuka", "6DoF", "75.00 ± 0.50 (1)"],
    "staged": ["6DoF", "the same", "the same"],
    "extended": ["6DoF", "1.234 ± 0.011", "366", "70.00 ± 0.50"],
    "strategies": ["6DoF", "6DoF → c1–c6"],
}


@pytest.mark.parametrize("table", ROWS)
def test_rows_of_tables_have_their_values_with_errors_and_intervals(table):
    row = EVERY[table][0]
    assert row[: len(ROWS[table])] == ROWS[table]
    assert len({len(each) for each in EVERY[table]}) == 1


def test_figures_that_differ_are_those_below_the_level_after_correction():
    assert [EVERY[name] for name in ("cells", "differ", "studies")] == ["4", "1", "16"]
    assert [row[0] for row in EVERY["outside"]] == ["Table 4: k_Σ at 20 (%)", "Table 4: dev at 20 (µm)"]
    fitted = comparison()
    fitted.loc[fitted.table == "2", "p_value"] = np.nan
    assert facts(comparison=fitted)["one_set"][0][-1] == "fitted"


def test_the_page_has_the_rows_of_each_table():
    def tables_of(stated):
        _, *parts = re.split(r"^## (.*)$", template("study_tables.md").render(stated), flags=re.MULTILINE)
        rows = {
            title: re.findall(r"^\| (.*) \|$", text, re.MULTILINE) for title, text in zip(parts[::2], parts[1::2], strict=True)
        }
        return {title: [line.split(" | ") for line in lines] for title, lines in rows.items()}

    found = tables_of(EVERY)
    assert [len(rows) - 1 for rows in found.values()] == [
        len(EVERY[name])
        for name in (*("joint", "table4", "break_even", "simulated", "needed", "smallest", "budget", "staged", "ladder"),)
    ]
    assert found["Random configurations for an accuracy"][1] == EVERY["needed"][0]
    assert all(len(row) == len(rows[0]) for rows in found.values() for row in rows)


@pytest.fixture(scope="module")
def pictures(tmp_path_factory):
    return [*empty_pictures(tmp_path_factory.mktemp("figures"), FIGURES), BIBLIOGRAPHY]


def write_report(path, stated, pictures, figures=FIGURES):
    shown = {name: [head, ["1.0 ± 0.1"] * len(head)] for name, head in HEAD.items()} | {"figures": figures}
    compile_document(path, "study.typ", {"facts": json.loads(json.dumps(stated, allow_nan=False)), "tables": shown}, pictures)


def test_the_report_is_a_pdf_that_the_same_facts_give_again(pictures, tmp_path):
    for name in "ab":
        write_report(tmp_path / f"{name}.pdf", EVERY, pictures)
    assert (tmp_path / "a.pdf").read_bytes().startswith(b"%PDF")
    assert (tmp_path / "a.pdf").read_bytes() == (tmp_path / "b.pdf").read_bytes()
