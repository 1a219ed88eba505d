"""README is understood at once: it is short, and its first screen answers. Its figures: test_figures_of_pages.py."""

import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")
MOST_LINES, MOST_WORDS, FIRST_SCREEN = 120, 1000, 25


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
