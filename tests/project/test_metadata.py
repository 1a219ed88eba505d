"""What the project says of itself, in every file the same: name, version, licence, authors, what it is to be cited with."""

import json
import re
import tomllib
from pathlib import Path

import pytest
import yaml

import elastocal

ROOT = Path(__file__).resolve().parents[2]
AUTHORS = "the elastocal developers"


def text(name):
    return (ROOT / name).read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def project():
    return tomllib.loads(text("pyproject.toml"))["project"]


@pytest.fixture(scope="module")
def citation():
    return yaml.safe_load(text("CITATION.cff"))


@pytest.fixture(scope="module")
def codemeta():
    return json.loads(text("codemeta.json"))


def test_every_file_has_the_version_of_the_package(citation, codemeta):
    assert citation["version"] == codemeta["version"] == elastocal.__version__
    assert f"({elastocal.__version__})" in text("CHANGELOG.md") or f"## {elastocal.__version__} " in text("CHANGELOG.md")


def test_the_licence_is_the_same_everywhere(project, citation, codemeta):
    assert project["license"] == citation["license"] == codemeta["license"].rpartition("/")[2] == "MIT"
    assert text("LICENSE").startswith("MIT License\n") and f" {AUTHORS}\n" in text("LICENSE")


def test_papers_cite_what_their_bibliography_has():
    """That of the software, and that of the study, whose labels of figures and tables look like references."""
    cited = set(re.findall(r"@([\w:-]+)", text("paper/paper.md").split("---\n", 2)[2]))
    study = text("src/elastocal/report/study.typ")
    labels = set(re.findall(r"<(\w+)>", study)) | set(re.findall(r'tag: "(\w+)"', study))
    cited |= set(re.findall(r"(?<!\w)@(\w+)", study)) - labels
    assert cited == set(re.findall(r"^@\w+\{([\w:-]+),$", text("paper/paper.bib"), re.MULTILINE))


def test_every_figure_of_the_paper_is_one_of_a_page():
    found = re.findall(r"<!-- (README\.md|docs/\w+\.md): (.*?) -->", text("paper/paper.md"))
    assert len(found) >= 4
    for page, words in found:
        assert words in text(page), (page, words)
