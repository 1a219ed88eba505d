"""What the report of the study states follows from its tables, with errors and intervals; the report and its page show it."""

import json
import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import typst
from drawn_figures import empty_pictures
from made_study_tables import comparison, facts, measured, simulated, tables

from elastocal.report.study import brief_names, paper_rows, paper_tables
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


def test_rows_that_say_the_same_are_listed_once_and_what_is_not_reached_is_said():
    alike = measured().assign(dev_20_um=8.0, k_sigma_fixed_joints_20_percent=lambda frame: frame.k_sigma_20_percent)
    assert [row[1] for row in facts(studies=alike)["table4"]] == ["6DoF", "6DoF"]
    assert EVERY["needed"][1][2] == "more than all (90 to more than all)"
    assert [row[2] for row in EVERY["simulated"]][:2] == ["none", "joint 1"]
    assert facts(simulated=simulated().assign(rms_um=900.0))["smallest"][0] == ["Kuka", "more than all", ""]


def test_sentences_state_counts_and_extremes():
    (reversed_,) = EVERY["reversed"]
    assert "Of 2 pairs" in reversed_ and "k_Σ of the fixed joints (1)." in reversed_
    assert "of 6DoF on Kuka is 2.00 times (1.50 to 2.50) that of staged, its RMS 0.83 times" in reversed_
    assert (
        "2 of 2 other sets leave significantly more error (1.03 to 1.10 times)"
        in facts(pairs=tables()["pairs"].assign(ratio_low=1.01))["equal"][0]
    )


def test_a_printed_figure_stands_beside_ours_and_lengths_beyond_a_data_set_are_marked():
    columns = ["table", "robot", "strategy", "quantity", "paper", "ours", "mc_std", "z"]
    rows = [("4", "kuka", "6DoF", "dev_20", 8.386, 9.03, 1.15, 0.56), ("1", "kuka", np.nan, "c1", 0.54, np.nan, 0.0, np.nan)]
    rows += [("4", "kuka", "6DoF", "n_dev_2_um", 43.0, value, 20.0, 1.0) for value in (99.0, 120.0, np.inf)]
    scored, without, inside, beyond, never = paper_rows(pd.DataFrame(rows, columns=columns), {"kuka": "KUKA"}, 100)
    assert scored["ours"] == "9.0 ± 1.1" and scored["robot"] == "KUKA" and "differs" not in scored
    assert (without["ours"], without["strategy"]) == ("not studied", "")
    assert (inside["ours"], beyond["ours"], never["ours"]) == ("99 ± 20", "120 ± 20†", "not reached")
    frame = pd.DataFrame({"robot": ["kuka"] * 3, "n_dev_2_um": [99.0, 120.0, np.inf], "n_dev_2_um_std_error": 20.0})
    (_, *lines) = paper_tables({"table4": frame}, {"kuka": "KUKA"}, 100)["table4"]
    assert lines == [["KUKA", "99 ± 20"], ["KUKA", "120 ± 20†"], ["KUKA", "not reached"]]


def test_names_are_as_short_as_they_may_be():
    titles = {"a": "KUKA KR 270", "b": "FANUC R-2000", "c": "KUKA KR 270 with elastic links"}
    assert brief_names(titles) == {"a": "KUKA", "b": "FANUC", "c": "KUKA with elastic links"}


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


@pytest.mark.parametrize(
    ("missing", "stated", "figures"),
    [
        ("figure5d", EVERY, [*FIGURES, "figure5d"]),
        ("smallest", {name: value for name, value in EVERY.items() if name != "smallest"}, FIGURES),
    ],
)
def test_what_is_missing_is_an_error_and_no_blank(missing, stated, figures, pictures, tmp_path):
    with pytest.raises(typst.TypstError, match=missing):
        write_report(tmp_path / "study.pdf", stated, pictures, figures)
    assert not list(tmp_path.iterdir())
