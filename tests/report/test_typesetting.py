"""A document compiles with its data and pictures, and its PDF appears complete or not
at all."""

import json
from collections import Counter
from importlib import resources

import pytest
import typst
from drawn_figures import empty_pictures
from jinja2 import UndefinedError

from elastocal.report.typesetting import compile_document, render_sentences
from elastocal.report.words import FILTERS

DOCUMENT = """#set document(date: none)
#let facts = json("facts.json")
#let other = json("other.json")
#assert.eq(facts, ("name": "Übermaß µ", "rows": ((1, 2.5), (none, true))))
#assert.eq(other, "x")
#facts.name #image("picture.pdf")
"""
DATA = {"facts": {"name": "Übermaß µ", "rows": [[1, 2.5], [None, True]]}, "other": "x"}


@pytest.fixture
def written(tmp_path, monkeypatch):
    """Return the folder of the results; the documents are in another folder."""
    documents = tmp_path / "documents"
    results = tmp_path / "results"
    documents.mkdir()
    results.mkdir()
    monkeypatch.setattr(resources, "files", {"elastocal.report": documents}.__getitem__)
    (documents / "made.typ").write_text(DOCUMENT, encoding="utf-8")
    (documents / "broken.typ").write_text("#nothing-of-this-name", encoding="utf-8")
    return results


def test_a_document_reads_its_data_and_pictures_as_they_were_given(written, tmp_path):
    compile_document(
        written / "made.pdf", "made.typ", DATA, empty_pictures(tmp_path, ["picture"])
    )
    assert (written / "made.pdf").read_bytes().startswith(b"%PDF")
    assert [file.name for file in written.iterdir()] == ["made.pdf"]


@pytest.mark.parametrize(
    "document, data, pictures, error, message",
    [
        ("made.typ", {"facts": float("nan")}, [], ValueError, "JSON"),
        ("made.typ", DATA, ["missing.pdf"], FileNotFoundError, "missing.pdf"),
        ("made.typ", DATA, [], typst.TypstError, "picture.pdf"),
        ("broken.typ", {}, [], typst.TypstError, "nothing-of-this-name"),
        ("unknown.typ", {}, [], FileNotFoundError, "unknown.typ"),
    ],
)
def test_a_document_that_cannot_be_compiled_leaves_the_earlier_pdf_unchanged(
    written, document, data, pictures, error, message
):
    (written / "report.pdf").write_text("earlier", encoding="utf-8")
    with pytest.raises(error, match=message):
        compile_document(written / "report.pdf", document, data, pictures)
    assert [file.name for file in written.iterdir()] == ["report.pdf"]
    assert (written / "report.pdf").read_text(encoding="utf-8") == "earlier"


def test_a_template_has_paragraphs_and_rows_and_keeps_non_breaking_blanks(
    tmp_path, monkeypatch
):
    template = "# one\n{% for n in (1, 2) %}\nA {{ n | format_probability }}\n"
    template += "  line.\n\n{% endfor %}\n"
    template += "## rows\na ¦ {{ b }} ¦\n{# no #}\n\nc ¦ d ¦ e\n"
    (tmp_path / "made.txt").write_text(template, encoding="utf-8")
    monkeypatch.setattr(resources, "files", {"elastocal.report": tmp_path}.__getitem__)
    sections = render_sentences("made.txt", FILTERS, b="x")
    assert sections == {
        "one": ["A >\u00a099\u00a0% line."] * 2,
        "rows": [["a", "x", ""], ["c", "d", "e"]],
    }
    # A missing fact is an error, not a gap in the text.
    with pytest.raises(UndefinedError, match="b"):
        render_sentences("made.txt", FILTERS)


def test_a_value_that_has_the_separator_of_cells_fills_one_cell(tmp_path, monkeypatch):
    """Otherwise the serial number 'A ¦ B' would certify the robot with number A."""
    template = "# one\n{{ b }}\n\n## rows\nserial ¦ {{ b }} ¦ {{ 1 }}\n"
    (tmp_path / "made.txt").write_text(template, encoding="utf-8")
    monkeypatch.setattr(resources, "files", {"elastocal.report": tmp_path}.__getitem__)
    assert render_sentences("made.txt", {}, b="A ¦ B") == {
        "one": ["A ¦ B"],
        "rows": [["serial", "A ¦ B", "1"]],
    }


@pytest.fixture
def count_rows(tmp_path):
    """Counts the rows of a table on each page, below a gap; `words` fill a row."""
    for file in resources.files("elastocal.report").iterdir():
        if file.name == "sheet.typ":
            (tmp_path / "sheet.typ").write_bytes(file.read_bytes())
    (tmp_path / "origin.json").write_text('""', encoding="utf-8")

    def count(rows, offset_mm, words="1"):
        document = tmp_path / "table.typ"
        document.write_text(
            f"""#import "sheet.typ": *
#show: sheet.with("table")
// Each row says on which page it stands.
#show regex("row \\d+"): it => [#it #context [#metadata(here().page())<page>]]
#v({offset_mm}mm)
#let rows = range({rows}).map(i => ("row " + str(i), "{words}"))
#records((1fr, 1fr), ("a", "b"), rows, [c])
""",
            encoding="utf-8",
        )
        pages = json.loads(typst.query(document, "<page>", field="value"))
        assert len(pages) == rows
        return Counter(pages)

    return count


@pytest.mark.parametrize("rows", [16, 41, 43, 60])
@pytest.mark.parametrize("offset_mm", [0, 60, 120, 150])
def test_a_table_that_breaks_leaves_no_fewer_than_three_rows_on_a_page(
    rows, offset_mm, count_rows
):
    assert min(count_rows(rows, offset_mm).values()) >= 3


@pytest.mark.parametrize("rows", [4, 5])
@pytest.mark.parametrize("offset_mm", [150, 190])
def test_a_table_of_few_rows_with_long_texts_stays_on_one_page(
    rows, offset_mm, count_rows
):
    assert len(count_rows(rows, offset_mm, words=60 * "word ")) == 1
