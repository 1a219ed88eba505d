"""What is stated of claims and questions, and the pages of the study's report that compile from it."""

from pathlib import Path

import pytest
import typst
from drawn_figures import empty_pictures
from made_study_tables import facts, question_facts

from elastocal.report.typesetting import compile_document

FIGURES = ["fig2", "fig3", "fig4", "fig5a", "fig5c", "table2_samples", "bias_and_accuracy", "accuracy_of_one_data_set"]
FIGURES += ["scores_against_paper", "ladder", "budget", "designs", "arm_map", "metrics", "studies", "costs"]
BIBLIOGRAPHY = Path(__file__).resolve().parents[2] / "paper" / "paper.bib"
EVERY = facts() | question_facts()
HEAD = {
    "table1": ["robot", "c1"],
    "table2": ["robot", "mean mm"],
    "table3": ["robot", "c1"],
    "table4": [f"n {k}" for k in range(8)],
    "interpretations": ["number", "open", "interpretation", "chosen on"],
}


@pytest.fixture(scope="module")
def pictures(tmp_path_factory):
    return [*empty_pictures(tmp_path_factory.mktemp("figures"), FIGURES), BIBLIOGRAPHY]


def write_report(path, stated, pictures, figures=FIGURES):
    tables = {name: [head, ["1.0 ± 0.1"] * len(head)] for name, head in HEAD.items()} | {"figures": figures}
    compile_document(path, "study.typ", {"facts": stated, "tables": tables}, pictures)


def test_the_report_is_a_pdf_that_the_same_facts_give_again(pictures, tmp_path):
    for name in "ab":
        write_report(tmp_path / f"{name}.pdf", EVERY, pictures)
    assert (tmp_path / "a.pdf").read_bytes().startswith(b"%PDF")
    assert (tmp_path / "a.pdf").read_bytes() == (tmp_path / "b.pdf").read_bytes()


@pytest.mark.parametrize(
    ("missing", "stated", "figures"),
    [
        ("fig5d", EVERY, [*FIGURES, "fig5d"]),
        ("claims", {name: value for name, value in EVERY.items() if name != "claims"}, FIGURES),
    ],
)
def test_a_figure_that_the_study_has_or_a_fact_that_is_missing_is_an_error_and_no_blank(
    missing, stated, figures, pictures, tmp_path
):
    with pytest.raises(typst.TypstError, match=missing):
        write_report(tmp_path / "study.pdf", stated, pictures, figures)
    assert not list(tmp_path.iterdir())
