"""Files and functions that pages name exist, and the README is short.

Its figures are checked by test_figures_of_pages.py.
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
# Files that commands make, files of a reader, and names that stand for others.
NOT_IN_REPOSITORY = re.compile(
    r"^(?:(?:reports|results|profiles|site|data/(?:simulated|campaigns|public))/"
    r"|campaigns/(?!importers))|^(?:/|\.)|NAME|CAMPAIGN|\.rst$|a/(?:test_)?b\.py$"
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


def list_paths(page):
    """List the paths of a page that are in backticks or that links lead to."""
    text = page.read_text(encoding="utf-8")
    targets = re.findall(r"\]\(([^)#\s]+)\)", text)
    links = {target for target in targets if "://" not in target}
    named = {path for path in PATH.findall(text) if "/" in path}
    return {path for path in links | named if not NOT_IN_REPOSITORY.search(path)}


def exists(path, page):
    return any((folder / path).exists() for folder in (page.parent, *TOPS))


def test_every_path_that_a_page_names_exists():
    paths = {(page, path) for page in PAGES for path in list_paths(page)}
    assert {path for page, path in paths if not exists(path, page)} == set()
    # The search must find paths at all.
    assert len({path for _, path in paths}) > 60


def test_a_function_that_is_named_with_a_module_is_in_that_module():
    architecture = (ROOT / "docs/architecture.md").read_text(encoding="utf-8")
    entries = re.findall(
        r"`([\w/]+\.py)`, functions? (`\w+`(?: and `\w+`)*)", architecture
    )
    assert len(entries) >= 3
    for module, names in entries:
        text = (ROOT / "src/elastocal" / module).read_text(encoding="utf-8")
        for name in re.findall(r"`(\w+)`", names):
            assert f"\ndef {name}(" in text, (module, name)


MAX_LINES = 120
MAX_WORDS = 1000
# The claim, a picture, a table, four commands and five lines of Python.
FIRST_SCREEN_LINES = 32


def test_the_readme_is_short():
    assert len(README.splitlines()) <= MAX_LINES
    assert len(README.split()) <= MAX_WORDS


def test_the_first_screen_has_the_claim_a_picture_the_figures_and_the_two_ways_in():
    first = README.partition("\n## ")[0].splitlines()
    assert len(first) <= FIRST_SCREEN_LINES
    assert sum("![" in line for line in first) == 1
    commands = [line.split("#")[0].strip() for line in first if line.startswith("    ")]
    assert commands[:4] == [
        "make paper",
        "make test",
        "make study",
        ".venv/bin/elastocal demo",
    ]
    assert commands[4] == "import elastocal as ec"
    assert len(commands) == 9
    screen = "\n".join(first)
    for phrase in (
        "Calibration of robot arms in Python",
        "before | after | noise floor",
        "false alarms",
        "true mechanism",
        "KUKA",
        "UR5",
    ):
        assert phrase in screen


def test_the_seven_steps_of_the_readme_are_in_their_order():
    steps = re.findall(r"^\d\. \*\*(\w+)\*\*", README, re.MULTILINE)
    assert steps == [
        "Plan",
        "Measure",
        "Check",
        "Diagnose",
        "Correct",
        "Certificate",
        "Verify",
    ]
