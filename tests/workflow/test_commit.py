"""The commit that a run names, and whether its sources were edited."""

import subprocess

import pytest

from commit import UNKNOWN, commit_of

WHO = [
    "-c",
    "user.name=somebody",
    "-c",
    "user.email=somebody@example.org",
    "-c",
    "commit.gpgsign=false",
]


def git(folder, *words):
    return subprocess.run(
        ["git", *WHO, "-C", folder, *words], check=True, capture_output=True, text=True
    ).stdout.strip()


@pytest.fixture
def checkout(tmp_path):
    git(tmp_path, "init", "-q")
    for name in ("Snakefile", "notes.md"):
        (tmp_path / name).write_text("a\n")
    git(tmp_path, "add", "-A")
    git(tmp_path, "commit", "-q", "-m", "a")
    return tmp_path


@pytest.mark.parametrize(
    ("edited", "ending"),
    [("notes.md", ""), ("Snakefile", "-dirty"), ("src/new.py", "-dirty")],
)
def test_a_checkout_is_its_commit_with_a_word_behind_it_where_a_source_is_edited_or_new(
    checkout, edited, ending
):
    assert commit_of(checkout, ["Snakefile", "src"]) == git(
        checkout, "rev-parse", "HEAD"
    )
    (checkout / edited).parent.mkdir(exist_ok=True)
    (checkout / edited).write_text("b\n")
    assert (
        commit_of(checkout, ["Snakefile", "src"])
        == git(checkout, "rev-parse", "HEAD") + ending
    )


def test_sources_inside_another_repository_or_without_git_have_no_commit(
    checkout, monkeypatch
):
    (checkout / "copy").mkdir()
    assert commit_of(checkout / "copy", ["Snakefile"]) == UNKNOWN
    monkeypatch.setenv("PATH", "")
    assert commit_of(checkout, ["Snakefile"]) == UNKNOWN
