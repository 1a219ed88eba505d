"""The statements in the report of the study follow from its tables, with errors and
intervals, and the report and its page show them."""

import json
import re
from pathlib import Path

import pandas as pd
import pytest
from drawn_figures import empty_pictures

from elastocal.report.study import collect_study_facts
from elastocal.report.typesetting import compile_document, load_template
from elastocal.study.strategies import Stage, Strategy

GOLDEN = Path(__file__).resolve().parents[1] / "golden"
# Golden table that stands for each table of the report.
FILES = {
    "joint": "joint_test",
    "studies": "strategies_over_studies",
    "break_even": "break_even",
    "ladder": "ladder",
}
FILES |= {
    "simulated": "simulated_designs",
    "budget": "budget",
    "pairs": "budget_pairs",
    "needed": "configurations_needed",
}
FILES |= {
    "scores": "strategy_scores",
    "score_pairs": "strategy_pairs",
    "comparison": "comparison",
    "table2": "table2",
}
FILES |= {
    "extended": "extended",
    "multiverse_summary": "multiverse_summary",
    "claims": "claims",
}


def table(name):
    return pd.read_csv(GOLDEN / f"study_{FILES[name]}.csv", dtype={"table": str})


def facts(**changed):
    """Facts of the report of these tables, some of which may be changed."""
    names = {"kuka": "Kuka", "kuka_extended": "Kuka with elastic links"}
    settings = {
        "noise_um": 200.0,
        "length": 20,
        "configurations": 20,
        "classical": "6DoF",
        "best": "3+6DoF comb",
    }
    settings |= {
        "accuracy_um": 120.0,
        "strategies": [Strategy("6DoF", (Stage(("6DoF",), tuple(range(6))),))],
    }
    stated = {
        "force_N": 1000,
        "offset_m": 0.5,
        "edge_m": 1.0,
        "weight_N": 1000,
        "path_m": 0.5,
        "cutting_N": 500,
    }
    study_facts = collect_study_facts(
        {name: table(name) for name in FILES} | changed,
        names,
        ["kuka"],
        settings | {"stated": stated},
    )
    return study_facts | {
        "citation": {
            "authors": "the developers",
            "version": "0.1.0",
            "license": "MIT",
        },
        "names": names,
        "full_names": ["Kuka"],
        "size": {
            "data_sets": "12",
            "configurations": "20",
            "test_configurations": "20",
            "seed": "1",
        },
    }


EVERY = facts()
FIGURES = [
    "figure2",
    "figure3",
    "figure4",
    "figure5a",
    "figure5c",
    "scores_against_paper",
    "multiverse",
    "ladder",
    "designs",
]
BIBLIOGRAPHY = Path(__file__).resolve().parents[2] / "paper" / "paper.bib"
HEAD = {
    "table1": ["robot", "c1"],
    "table2": ["robot", "mean mm"],
    "table3": ["robot", "c1"],
    "table4": [f"n {k}" for k in range(8)],
}
# First rows of tables, in words, as they follow from the golden files.
ROWS = {
    "detectable": ["compliances of Table 3", "6"],
    "one_set": ["Kuka", "mean", "0.929", "1.069", "1.07 ± 0.17", "fitted"],
    "joint": [
        "fixed joints",
        "18",
        "0",
        "2.1",
        "2.0 (to 3.2)",
        "0.45",
        "0",
        "0 (to 0)",
        "1",
    ],
    "table4": [
        "Kuka",
        "6DoF",
        "4.8 ± 3.3",
        "4.8 ± 3.3",
        "97 ± 67†",
        "97 ± 67†",
        "17.0 ± 7.5",
        "170 ± 75†",
        "-0.1 ± 3.4",
    ],
    "over_studies": ["Kuka", "17.0 ± 7.5", "67 ± 11", "3.9", "1.40", "13.3 ± 7.3"],
    "break_even": ["Kuka", "6DoF twice", "5.9", "11.4", "0.08 (0.00 to 15.54)"],
    "budget": ["Kuka", "6DoF", "72 ± 11", "40", "", ""],
    "needed": ["Kuka", "6DoF", "12 (8 to 18)", "12"],
    "ladder": ["50", "10", "651 ± 40", "114 ± 11", "5", "121 ± 14"],
    "smallest": ["Kuka", "5", "67.6 ± 5.3"],
    "simulated": [
        "Kuka",
        "random",
        "none",
        "79.6 ± 2.9",
        "36.7 ± 4.4",
        "47.5 ± 6.2",
        "41.2 ± 5.5",
        "1.93",
    ],
    "scores": ["Kuka", "6DoF", "72 ± 11 (3)", "144.6 ± 6.5 (3)"],
    "staged": ["6DoF", "the same"],
    "extended": ["6DoF", "2.26 ± 0.26", "364 ± 115", "83.9 ± 3.3"],
    "strategies": ["6DoF", "6DoF → c1–c6"],
}


@pytest.mark.parametrize("name", ROWS)
def test_rows_of_tables_have_their_values_with_errors_and_intervals(name):
    assert EVERY[name][0][: len(ROWS[name])] == ROWS[name]
    assert len({len(row) for row in EVERY[name]}) == 1


def test_figures_that_differ_are_those_below_the_level_after_correction():
    assert [EVERY[name] for name in ("cells", "differ", "studies", "rejected")] == [
        "18",
        "0",
        "19",
        "no",
    ]
    assert EVERY["outside"] == []
    comparison = table("comparison")
    tested = comparison.p_value.notna()
    first = comparison.index[tested][0]
    comparison.loc[first, ["p_value", "p_corrected"]] = 0.02, 0.04
    comparison.loc[comparison.index[tested][1], "p_value"] = 0.03
    joint = table("joint")
    joint["below_p"] = 0.03
    changed_facts = facts(comparison=comparison, joint=joint)
    assert changed_facts["differ"] == "1"
    assert changed_facts["rejected"] == "yes"
    assert changed_facts["outside"][0][-2:] == ["0.02", "0.04"]
    assert len(changed_facts["outside"]) == 2


def test_a_second_name_of_an_estimator_says_which_it_is():
    studies = table("studies")
    comb = studies[studies.strategy == "3+6DoF comb"]
    again = comb.assign(strategy="4-6DoF after 6+3DoF")
    fixed = [name for name in studies if "fixed_joints" in name]
    again[fixed] = again[fixed] / 2
    rows = facts(studies=pd.concat([studies, again]))["table4"]
    assert rows[-1][1] == "4-6DoF after 6+3DoF (estimator: 3+6DoF comb)"
    # With the same joints fixed, it is the same row.
    same = facts(studies=pd.concat([studies, comb.assign(strategy="other")]))
    assert len(same["table4"]) == len(EVERY["table4"])
    assert EVERY["estimators_count"] == "3"


def test_the_page_has_the_rows_of_each_table():
    def tables_of(stated):
        _, *parts = re.split(
            r"^## (.*)$",
            load_template("study_tables.md").render(stated),
            flags=re.MULTILINE,
        )
        tables = {}
        for title, text in zip(parts[::2], parts[1::2], strict=True):
            lines = re.findall(r"^\| (.*) \|$", text, re.MULTILINE)
            tables[title] = [line.split(" | ") for line in lines]
        return tables

    page_tables = tables_of(EVERY)
    assert [len(rows) - 1 for rows in page_tables.values()] == [
        len(EVERY[name])
        for name in (
            *(
                "joint",
                "outside",
                "detectable",
                "multiverse",
                "claims",
                "table4",
                "break_even",
                "simulated",
                "needed",
                "smallest",
                "by_size",
                "budget",
                "staged",
                "ladder",
            ),
        )
    ]
    assert page_tables["Random configurations for an accuracy"][1] == EVERY["needed"][0]
    assert all(
        len(row) == len(rows[0]) for rows in page_tables.values() for row in rows
    )


@pytest.fixture(scope="module")
def pictures(tmp_path_factory):
    return [*empty_pictures(tmp_path_factory.mktemp("figures"), FIGURES), BIBLIOGRAPHY]


def write_report(path, stated, pictures):
    shown = {name: [head, ["1.0 ± 0.1"] * len(head)] for name, head in HEAD.items()}
    compile_document(
        path,
        "study.typ",
        {"facts": json.loads(json.dumps(stated, allow_nan=False)), "tables": shown},
        pictures,
    )


def test_the_report_is_a_pdf_that_the_same_facts_give_again(pictures, tmp_path):
    for name in "ab":
        write_report(tmp_path / f"{name}.pdf", EVERY, pictures)
    assert (tmp_path / "a.pdf").read_bytes().startswith(b"%PDF")
    assert (tmp_path / "a.pdf").read_bytes() == (tmp_path / "b.pdf").read_bytes()
