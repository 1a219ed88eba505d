"""Files that pages name are there, a function that stands beside a module is in it,
rooms have the limits of the lint.

README is understood at once: it is short, and its first screen answers. Its figures:
test_figures_of_pages.py.
"""

import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PAGES = [
    *(
        ROOT / name
        for name in (
            "README.md",
            "CONTRIBUTING.md",
            "SECURITY.md",
            "CODE_OF_CONDUCT.md",
            "paper/paper.md",
        )
    ),
    *sorted((ROOT / "docs").rglob("*.md")),
    *(ROOT / name for name in ("config/README.md", "benchmarks/README.md")),
]
# A path of the repository in backticks or in a table: with a folder, or a module by its
# name alone.
PATH = re.compile(
    r"`((?:[\w.-]+/)*[\w-]+\.(?:py|smk|yaml|csv|typ|txt|toml|cff|lock|sh)|(?:[\w.-]+/)+)`"
)
# What commands make, what a reader has, and places for names of one's own.
MADE = re.compile(
    r"^(?:(?:reports|results|profiles|site|data/(?:simulated|campaigns|public))/|campaigns/(?!importers))|^(?:/|\.)|NAME|CAMPAIGN|\.rst$|a/(?:test_)?b\.py$"
)
README = (ROOT / "README.md").read_text(encoding="utf-8")
PACKAGE = ROOT / "src/elastocal"
PROOF = ROOT / "src/elastocal_proof"
TOPS = [
    ROOT,
    ROOT / "src",
    PACKAGE,
    PROOF,
    PACKAGE / "diagnosis",
    PROOF / "blind",
    ROOT / "docs",
]


def paths_of(page):
    """Those in backticks and those that links lead to."""
    text = page.read_text(encoding="utf-8")
    links = {
        link for link in re.findall(r"\]\(([^)#\s]+)\)", text) if "://" not in link
    }
    return {
        path
        for path in links | {*PATH.findall(text)}
        if (path in links or "/" in path) and not MADE.search(path)
    }


def test_every_path_that_a_page_names_is_there():
    found = {(page, path) for page in PAGES for path in paths_of(page)}
    assert {
        path
        for page, path in found
        if not any((folder / path).exists() for folder in (page.parent, *TOPS))
    } == set()
    # Lest the search find none.
    assert len({path for _, path in found}) > 60


def architecture():
    return (ROOT / "docs/architecture.md").read_text(encoding="utf-8")


def test_a_function_beside_a_module_is_one_of_it():
    found = re.findall(
        r"`([\w/]+\.py)`, functions? (`\w+`(?: and `\w+`)*)", architecture()
    )
    assert len(found) >= 3
    for module, words in found:
        text = (ROOT / "src/elastocal" / module).read_text(encoding="utf-8")
        assert [
            name
            for name in re.findall(r"\w+", words.replace(" and ", " "))
            if f"\ndef {name}(" not in text
        ] == []


MOST_LINES = 120
MOST_WORDS = 1000
FIRST_SCREEN = 25


def test_it_is_read_in_minutes():
    assert len(README.splitlines()) <= MOST_LINES
    assert len(README.split()) <= MOST_WORDS


def test_the_first_screen_has_the_claim_a_picture_the_figures_and_four_commands():
    first = README.partition("\n## ")[0].splitlines()
    assert len(first) <= FIRST_SCREEN
    assert sum("![" in line for line in first) == 1
    commands = [line.split("#")[0].strip() for line in first if line.startswith("    ")]
    assert commands == [
        "make paper",
        "make test",
        "make study",
        ".venv/bin/elastocal demo",
    ]
    screen = "\n".join(first)
    for words in (
        "uncorrected | corrected | noise floor",
        "false alarms",
        "named correctly",
        "KUKA",
        "UR5",
    ):
        assert words in screen


def test_the_six_steps_are_in_their_order():
    steps = re.findall(r"^\d\. \*\*(\w+)\*\*", README, re.MULTILINE)
    assert steps == ["Plan", "Measure", "Check", "Diagnose", "Correct", "Certificate"]
