"""Each figure of a page stands in the table that it is from, and a page has no figure
without a source.

CI replaces the copies of tables in docs by those of its own run before it runs these
tests, so a page is compared with the run.

`figures_of_pages.yaml` says where each is from: of a page and a source the words of the
page, and in which table (by the heading above it), row and column their numbers stand,
or in which sentence (no column). Sources are pages and CSV files that commands write
into docs/ (`make pictures`, the blind proof, the league) or, of runs of hours, the
table of the page itself. Figures that come from no table (settings, earlier runs) are
listed under `without a table`, with what made them.
"""

import re
from decimal import ROUND_HALF_UP, Decimal
from pathlib import Path

import pandas as pd
import pytest
import yaml

from elastocal.effects import catalogue

ROOT = Path(__file__).resolve().parents[2]
SOURCES = yaml.safe_load(
    Path(__file__).with_name("figures_of_pages.yaml").read_text(encoding="utf-8")
)
NUMBER = re.compile(r"(?<![\w.])[−-]?\d+(?:\.\d+)?")
# A figure of a result: with decimals, an interval, a share, a count of counts. Whole
# numbers of things are none.
FIGURE = re.compile(
    r"(?<![\w.–/-])[−+]?(?:\d+\.\d+(?:[–-]\d+(?:\.\d+)?)?|\d+(?:\.\d+)?[–-]\d+(?:\.\d+)?(?=\)| %)|\d+ (?:%|µm)|\d+ of \d+)"
)
# Measured by whoever runs it, levels of confidence, versions, links and code.
NONE = re.compile(
    r"[\d.]+ minutes?|(?<!\d )95 %|Python [\d.]+|\[[^\]]*\]\([^)]*\)|`[^`]*`|!\[.*?\]\(.*?\)"
)


def plain(text):
    """Text with plain signs, and without marks of thousands: "1 000" and "1,000" are
    one number."""
    text = text.replace("\u2212", "-").replace("**", "")
    return re.sub(r"(?<=\d)[ ,\u2009\u202f\u00a0](?=\d{3}(?!\d))", "", text)


def numbers(text):
    return [
        number.lstrip("-") for number in NUMBER.findall(plain(text).replace("–", " "))
    ]


def tables(path):
    """Tables of a page by the words of the heading above each; of a CSV file the file,
    under ""."""
    if path.suffix == ".csv":
        return [("steps", pd.read_csv(path, dtype=str))]
    found = []
    heading = ""
    lines = path.read_text(encoding="utf-8").splitlines()
    for number, line in enumerate(lines):
        heading = line.lstrip("# ") if line.startswith("#") else heading
        if re.fullmatch(r"\|[\s:|-]+\|", line):
            rows = []
            for each in (lines[number - 1], *lines[number + 1 :]):
                if not each.startswith("|"):
                    break
                rows.append(
                    [cell.strip() for cell in each.strip().strip("|").split("|")]
                )
            found.append((heading, pd.DataFrame(rows[1:], columns=rows[0])))
    return found


def cell(source, heading, row, column):
    """The one cell of a source whose row begins with these words and whose column is
    named so."""
    keys = row if isinstance(row, list) else [row]
    found = []
    for words, frame in tables(ROOT / source):
        if heading not in words or column not in frame:
            continue
        here = frame[
            [
                all(str(a) == str(b) for a, b in zip(keys, line, strict=False))
                for line in frame.to_numpy().tolist()
            ]
        ]
        found += (
            here[column].tolist()
            if here[column].ndim == 1
            else here[column].iloc[:, 0].tolist()
        )
    assert len(found) == 1, (source, heading, row, column, found)
    return found[0]


def entries():
    for page, sources in SOURCES.items():
        for source, headings in sources.items():
            if source != "without a table":
                for heading, lines in headings.items():
                    for words, row, column in lines:
                        yield page, source, heading, words, row, column


def stands(number, found):
    """Whether a number is one of those found, rounded to its own digits."""
    digits = Decimal(1).scaleb(-len(number.partition(".")[2]))
    return any(
        Decimal(other).quantize(digits, ROUND_HALF_UP) == Decimal(number)
        for other in found
    )


@pytest.mark.parametrize(
    ("page", "source", "heading", "words", "row", "column"), list(entries())
)
def test_a_figure_is_that_of_its_table(page, source, heading, words, row, column):
    assert plain(words) in plain((ROOT / page).read_text(encoding="utf-8"))
    if column is None:
        assert row in (ROOT / source).read_text(encoding="utf-8") and set(
            numbers(words)
        ) <= set(numbers(row))
        return
    found = cell(source, heading, row, column)
    if column == "effects":
        assert stated_effects(words) == named_effects(found)
        return
    values = numbers(found)
    if source.endswith(".csv") and "_over_" not in column:
        # Errors of a run are in metres, those of a page in millimetres.
        values = [str(1000 * Decimal(found))]
    stated = numbers(words)
    assert [number for number in stated if not stands(number, values)] == [], found


def named_effects(cell):
    """Names and joints of a cell like "link_weight (joint 2, 3) + payload"."""
    effects = set()
    for entry in cell.split(" + "):
        name, _, joints = entry.partition(" ")
        effects.add((catalogue.list_effects()[name].words, *re.findall(r"\d", joints)))
    return effects


def stated_effects(words):
    """Names and joints of words like "gravity sag of joints 2 to 4 and payload"."""
    effects = set()
    for entry in words.split(" and "):
        name, _, joints = entry.partition(" of joint")
        numbers_of_joints = re.findall(r"\d", joints)
        if " to " in joints:
            first, last = map(int, numbers_of_joints)
            numbers_of_joints = [str(joint) for joint in range(first, last + 1)]
        effects.add((name, *numbers_of_joints))
    return effects


def test_stated_effects_are_compared_by_name_and_joint():
    cell = "link_weight (joint 2, 3) + payload"
    words = "gravity sag of joints 2 to 3 and weight of an undeclared payload"
    assert stated_effects(words) == named_effects(cell)
    assert stated_effects("gravity sag of joint 2") != named_effects(cell)


def prose(page):
    """A page without code and what is no figure; of all but the README without tables,
    which are sources or of long runs."""
    text = (ROOT / page).read_text(encoding="utf-8")
    text = re.sub(r"```.*?```", "", text, flags=re.DOTALL)
    text = re.sub(r"(?m)^ {4,}(?!- |\d).*$", "", text)
    if page != "README.md":
        text = re.sub(r"(?m)^\|.*$", "", text)
    return plain(NONE.sub("", text))


def uncovered(page):
    text = prose(page)
    stated = [words for of_page, *_, words, _, _ in entries() if of_page == page]
    stated += [
        words
        for lines in SOURCES[page].get("without a table", {}).values()
        for words in lines
    ]
    covered = {
        place
        for words in stated
        for found in re.finditer(re.escape(plain(str(words))), text)
        for place in range(*found.span())
    }
    return [
        found[0]
        for found in FIGURE.finditer(text)
        if not covered.issuperset(range(*found.span()))
    ]


@pytest.mark.parametrize("page", SOURCES)
def test_no_figure_is_without_a_source(page):
    assert uncovered(page) == []


@pytest.mark.parametrize("page", SOURCES)
def test_what_is_listed_without_a_table_stands_on_the_page(page):
    text = plain((ROOT / page).read_text(encoding="utf-8"))
    listed = [
        str(words)
        for lines in SOURCES[page].get("without a table", {}).values()
        for words in lines
    ]
    assert [words for words in listed if plain(words) not in text] == []


def test_every_page_is_looked_at():
    """But for the pages of tables, which commands write."""
    pages = {
        f"docs/{page.name}"
        for page in (ROOT / "docs").glob("*.md")
        if not page.name.endswith("_tables.md")
    }
    assert set(SOURCES) == pages | {"README.md"} and len(list(entries())) > 100
