"""README is understood at once and believed: it is short, its first screen answers, and each figure stands on a linked page."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")
MOST_LINES, MOST_WORDS, FIRST_SCREEN = 120, 1000, 25
# A figure with decimals, or one with a unit; "two commands" and "R-2000iC" are none.
FIGURE = re.compile(
    r"(?<![\w.–])(?:\d[\d,]*\.\d+(?:–[\d.]+\d)?|\d{1,3}(?:,\d{3})+|\d+–\d+(?=\))|\d+ of \d+"
    r"|\d+(?= (?:%|µm|mm|rows|points)))"
)
# What a run takes is measured by whoever runs it; a version is no figure.
DURATION = re.compile(r"\d+ minutes?|Python [\d.]+")


def blocks():
    """Paragraphs, items of lists and tables, without code."""
    text = re.sub(r"(?m)^ {4,}(?!- |\d).*$", "", README)
    return [block for block in re.split(r"\n\s*\n|\n(?=- |\d\. )", text) if block.strip()]


def pages_of(block):
    return "".join((ROOT / page).read_text(encoding="utf-8") for page in re.findall(r"\((docs/[\w/]+\.md)\)", block))


def figures(block):
    return FIGURE.findall(DURATION.sub("", block))


def test_it_is_read_in_minutes():
    assert len(README.splitlines()) <= MOST_LINES
    assert len(README.split()) <= MOST_WORDS


def test_the_first_screen_has_the_claim_a_picture_the_figures_and_three_commands():
    first = README.partition("\n## ")[0].splitlines()
    assert len(first) <= FIRST_SCREEN
    assert sum("![" in line for line in first) == 1
    commands = [line.split("#")[0].strip() for line in first if line.startswith("    ")]
    assert commands == ["make paper", "make study", ".venv/bin/elastocal demo"]
    screen = "\n".join(first)
    for words in ("uncorrected | corrected | noise floor", "false alarms", "named correctly", "KUKA", "UR5"):
        assert words in screen


def test_the_six_steps_are_in_their_order():
    steps = re.findall(r"^\d\. \*\*(\w+)\*\*", README, re.MULTILINE)
    assert steps == ["Plan", "Measure", "Check", "Diagnose", "Correct", "Certificate"]


@pytest.mark.parametrize("block", [block for block in blocks() if figures(block)], ids=lambda block: block.strip()[:30])
def test_every_figure_stands_on_a_page_that_the_same_block_links(block):
    text = pages_of(block)
    assert text, "no page is linked"
    assert [figure for figure in figures(block) if figure not in text] == []


def test_the_search_finds_figures_of_each_kind():
    """Lest it pass because it finds none."""
    found = [figure for block in blocks() for figure in figures(block)]
    assert {"2.99", "0.0979", "87", "83–90", "5,510", "60", "30–34"} <= set(found) and len(found) > 30
