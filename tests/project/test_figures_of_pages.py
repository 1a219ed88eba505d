"""Each figure on a page is in the table of its source, and each figure has a source.

`figures_of_pages.yaml` lists the figures: for each page and source the words of the page
and the table (by the heading above it), row and column that hold their numbers, or a
sentence (no column). Sources are pages and CSV files that commands write into docs
(`make pictures`, the blind benchmark, the league), or the table of the page itself if
its run takes hours. Figures without a table (settings, earlier runs) are listed under
`without a table`, with their origin.

CI replaces the copies of tables in docs by the files of its own run before it runs these
tests, so the pages are compared with the run.
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
# Figures of results: numbers with decimals, intervals, shares, and counts out of counts.
# Whole numbers of things are not figures.
FIGURE = re.compile(
    r"(?<![\w.–/-])[−+]?(?:"
    r"\d+\.\d+(?:[–-]\d+(?:\.\d+)?)?"
    r"|\d+(?:\.\d+)?[–-]\d+(?:\.\d+)?(?=\)| %)"
    r"|\d+ (?:%|µm)"
    r"|\d+ of \d+)"
)
# Text without figures: durations on the reader's machine, levels of confidence,
# versions, links and code.
NO_FIGURES = re.compile(
    r"[\d.]+ minutes?|(?<!\d )95 %|Python [\d.]+"
    r"|\[[^\]]*\]\([^)]*\)|`[^`]*`|!\[.*?\]\(.*?\)"
)


def normalize(text):
    """Replace special signs, and remove marks of thousands: "1 000" equals "1,000"."""
    text = text.replace("\u2212", "-").replace("**", "")
    return re.sub(r"(?<=\d)[ ,\u2009\u202f\u00a0](?=\d{3}(?!\d))", "", text)


def list_numbers(text):
    numbers = NUMBER.findall(normalize(text).replace("–", " "))
    return [number.lstrip("-") for number in numbers]


def split_row(line):
    return [cell.strip() for cell in line.strip().strip("|").split("|")]


def read_tables(path):
    """Read the tables of a page, each with the heading above it, or one CSV file."""
    if path.suffix == ".csv":
        return [("steps", pd.read_csv(path, dtype=str))]
    tables = []
    heading = ""
    lines = path.read_text(encoding="utf-8").splitlines()
    for number, line in enumerate(lines):
        if line.startswith("#"):
            heading = line.lstrip("# ")
        if re.fullmatch(r"\|[\s:|-]+\|", line):
            rows = []
            for row in lines[number + 1 :]:
                if not row.startswith("|"):
                    break
                rows.append(split_row(row))
            columns = split_row(lines[number - 1])
            tables.append((heading, pd.DataFrame(rows, columns=columns)))
    return tables


def begins_with(row, keys):
    return all(str(cell) == str(key) for key, cell in zip(keys, row, strict=False))


def find_cell(source, heading, row, column):
    """Return the only cell of a source in a column, in a row that begins with keys."""
    keys = row if isinstance(row, list) else [row]
    cells = []
    for table_heading, table in read_tables(ROOT / source):
        if heading not in table_heading or column not in table:
            continue
        position = list(table.columns).index(column)
        rows = table.to_numpy().tolist()
        cells += [
            cells_of_row[position]
            for cells_of_row in rows
            if begins_with(cells_of_row, keys)
        ]
    assert len(cells) == 1, (source, heading, row, column, cells)
    return cells[0]


def list_entries():
    entries = []
    for page, sources in SOURCES.items():
        for source, headings in sources.items():
            if source == "without a table":
                continue
            for heading, lines in headings.items():
                entries += [(page, source, heading, *line) for line in lines]
    return entries


def is_rounded_from(number, values):
    """Whether a number is one of some values, rounded to the digits of the number."""
    digits = Decimal(1).scaleb(-len(number.partition(".")[2]))
    rounded = [Decimal(value).quantize(digits, ROUND_HALF_UP) for value in values]
    return Decimal(number) in rounded


@pytest.mark.parametrize(
    ("page", "source", "heading", "words", "row", "column"), list_entries()
)
def test_a_figure_is_that_of_its_table(page, source, heading, words, row, column):
    assert normalize(words) in normalize((ROOT / page).read_text(encoding="utf-8"))
    if column is None:
        assert row in (ROOT / source).read_text(encoding="utf-8")
        assert set(list_numbers(words)) <= set(list_numbers(row))
        return
    cell = find_cell(source, heading, row, column)
    if column == "effects":
        assert stated_effects(words) == named_effects(cell)
        return
    values = list_numbers(cell)
    if source.endswith(".csv") and "_over_" not in column:
        # Errors of a run are in metres, those of a page in millimetres.
        values = [str(1000 * Decimal(cell))]
    wrong = [
        number for number in list_numbers(words) if not is_rounded_from(number, values)
    ]
    assert wrong == [], cell


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
    # A comma or an "and" before a digit separates joints, before a word effects.
    for entry in re.split(r"(?:, and|,| and) (?=[a-z])", words):
        name, _, joints = entry.partition(" of joint")
        numbers_of_joints = re.findall(r"\d", joints)
        if " to " in joints:
            first, last = map(int, numbers_of_joints)
            numbers_of_joints = [str(joint) for joint in range(first, last + 1)]
        effects.add((name, *numbers_of_joints))
    return effects


def test_stated_effects_are_compared_by_name_and_joint():
    cell = "link_weight (joint 2, 3) + payload"
    sentence = "gravity sag of joints 2 to 3 and weight of an undeclared payload"
    assert stated_effects(sentence) == named_effects(cell)
    assert stated_effects("gravity sag of joint 2") != named_effects(cell)
    longer_cell = "payload + link_weight (joint 2, 3, 5) + transmission_ratio (joint 1)"
    longer_sentence = (
        "gear ratio or coupling error of joint 1, gravity sag of joints 2, 3 and 5, "
        "and weight of an undeclared payload"
    )
    assert stated_effects(longer_sentence) == named_effects(longer_cell)


def read_prose(page):
    """Read a page without code and without text that has no figures.

    Tables are left out, except in the README, because they are sources or belong to
    long runs.
    """
    text = (ROOT / page).read_text(encoding="utf-8")
    text = re.sub(r"```.*?```", "", text, flags=re.DOTALL)
    text = re.sub(r"(?m)^ {4,}(?!- |\d).*$", "", text)
    if page != "README.md":
        text = re.sub(r"(?m)^\|.*$", "", text)
    return normalize(NO_FIGURES.sub("", text))


def listed_without_table(page):
    groups = SOURCES[page].get("without a table", {}).values()
    return [str(text) for group in groups for text in group]


def find_figures_without_source(page):
    text = read_prose(page)
    listed = [entry[3] for entry in list_entries() if entry[0] == page]
    covered = set()
    for listed_text in [*listed, *listed_without_table(page)]:
        for match in re.finditer(re.escape(normalize(str(listed_text))), text):
            covered.update(range(*match.span()))
    return [
        match[0]
        for match in FIGURE.finditer(text)
        if not covered.issuperset(range(*match.span()))
    ]


@pytest.mark.parametrize("page", SOURCES)
def test_no_figure_is_without_a_source(page):
    assert find_figures_without_source(page) == []


@pytest.mark.parametrize("page", SOURCES)
def test_words_that_are_listed_without_a_table_are_on_the_page(page):
    text = normalize((ROOT / page).read_text(encoding="utf-8"))
    absent = [
        listed_text
        for listed_text in listed_without_table(page)
        if normalize(listed_text) not in text
    ]
    assert absent == []


def test_every_page_is_checked():
    """Pages of tables are left out, because commands write them; tests/blind/test_power.py
    computes the page of the registration."""
    pages = {
        f"docs/{page.name}"
        for page in (ROOT / "docs").glob("*.md")
        if not page.name.endswith("_tables.md") and page.name != "blind_registration.md"
    }
    assert set(SOURCES) == pages | {"README.md"}
    assert len(list_entries()) > 100
