"""Files that pages name are there, a function that stands beside a module is in it, and rooms have the limits of the lint."""

import re
import runpy
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PAGES = [
    *(ROOT / name for name in ("README.md", "CONTRIBUTING.md", "paper/paper.md")),
    *sorted((ROOT / "docs").rglob("*.md")),
    *(ROOT / name for name in ("config/README.md", "benchmarks/README.md")),
]
# A path of the repository in backticks or in a table: with a folder, or a module by its name alone.
PATH = re.compile(r"`((?:[\w.-]+/)*[\w-]+\.(?:py|smk|yaml|csv|typ|txt|toml|cff|lock|sh)|(?:[\w.-]+/)+)`")
# What commands make, what a reader has, and places for names of one's own.
MADE = re.compile(
    r"^(?:(?:reports|results|profiles|site|data/(?:simulated|campaigns|public))/|campaigns/(?!importers))|^(?:/|\.)|NAME|CAMPAIGN|a/(?:test_)?b\.py$"
)
PACKAGE, PROOF = ROOT / "src/elastocal", ROOT / "src/elastocal_proof"
TOPS = [ROOT, ROOT / "src", PACKAGE, PROOF, PACKAGE / "diagnosis", PROOF / "blind", ROOT / "docs"]


def paths_of(page):
    return sorted({path for path in PATH.findall(page.read_text(encoding="utf-8")) if "/" in path and not MADE.search(path)})


def test_every_path_that_a_page_names_is_there():
    found = {(page, path) for page in PAGES for path in paths_of(page)}
    assert {path for page, path in found if not any((folder / path).exists() for folder in (page.parent, *TOPS))} == set()
    # Lest the search find none.
    assert len({path for _, path in found}) > 60


def architecture():
    return (ROOT / "docs/architecture.md").read_text(encoding="utf-8")


def test_a_function_beside_a_module_is_one_of_it():
    found = re.findall(r"`([\w/]+\.py)`, functions? (`\w+`(?: and `\w+`)*)", architecture())
    assert len(found) >= 3
    for module, words in found:
        text = (ROOT / "src/elastocal" / module).read_text(encoding="utf-8")
        assert [name for name in re.findall(r"\w+", words.replace(" and ", " ")) if f"\ndef {name}(" not in text] == []


def test_rooms_and_their_limits_are_those_of_the_lint():
    rooms = runpy.run_path(str(ROOT / "workflow/lint.py"))["ROOMS"]
    stated = re.findall(r"^\| `([\w/]+)` \| .* \| [\d,]+ \| ([\d,]+) \|$", architecture(), re.MULTILINE)
    assert {room: int(limit.replace(",", "")) for room, limit in stated} == {
        room.removeprefix("src/"): limit for room, limit in rooms.items() if (ROOT / room).is_dir()
    }
