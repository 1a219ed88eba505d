"""The commit that a run names, and whether its sources were edited."""

import subprocess

import pytest

from commit import UNKNOWN, commit_of

WHO = ["-c", "user.name=somebody", "-c", "user.email=somebody@example.org", "-c", "commit.gpgsign=false"]


def git(folder, *words):
    return subprocess.run(["git", *WHO, "-C", folder, *words], check=True, capture_output=True, text=True).stdout.strip()


@pytest.fixture
def checkout(tmp_path):
    git(tmp_path, "init", "-q")
    for name in ("Snakefile", "notes.md"):
        (tmp_path / name).write_text("a\n")
    git(tmp_path, "add", "-A")
    git(tmp_path, "commit", "-q", "-m", "a")
    return tmp_path


def test_a_clean_checkout_is_its_commit(checkout):
    assert commit_of(checkout, ["Snakefile", "src"]) == git(checkout, "rev-parse", "HEAD")


@pytest.mark.parametrize("name", ["Snakefile", "src/new.py"])
def test_an_edited_or_new_source_is_said_behind_it(checkout, name):
    (checkout / name).parent.mkdir(exist_ok=True)
    (checkout / name).write_text("b\n")
    assert commit_of(checkout, ["Snakefile", "src"]) == git(checkout, "rev-parse", "HEAD") + "-dirty"


def test_an_edited_page_is_no_edited_source(checkout):
    (checkout / "notes.md").write_text("b\n")
    assert not commit_of(checkout, ["Snakefile", "src"]).endswith("-dirty")


def test_sources_inside_of_another_repository_have_no_commit_nor_have_those_without_one_or_without_git(checkout, monkeypatch):
    (checkout / "copy").mkdir()
    assert commit_of(checkout / "copy", ["Snakefile"]) == UNKNOWN
    monkeypatch.setenv("PATH", "")
    assert commit_of(checkout, ["Snakefile"]) == UNKNOWN
