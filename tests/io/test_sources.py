"""Digests of sources: comments, docstrings and layout do not count, everything else does."""

from pathlib import Path

import pytest

from elastocal.io.records import checksum
from elastocal.io.sources import _kept, keep_source_digests, source_digest

CODE = '''"""A module."""

from math import pi


class Circle:
    """A class."""

    radius = 2.0

    def area(self):
        """A method."""
        return pi * self.radius**2
'''


@pytest.fixture
def digest(tmp_path, monkeypatch):
    """Of a text as a file of this name."""
    monkeypatch.chdir(tmp_path)

    def digest(text, name="module.py"):
        Path(name).write_text(text, encoding="utf-8")
        return source_digest(name)

    yield digest
    _kept.cache_clear()


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("A module", "Another module"),
        ('    """A class."""\n', ""),
        ("A method", "Another method"),
        ("**2", "**2  # squared"),
        ("self.radius**2", "(self.radius**2)"),
        ("pi *", "pi\\\n*"),
    ],
)
def test_comments_docstrings_and_layout_do_not_count(digest, old, new):
    assert CODE.count(old) == 1
    assert digest(CODE.replace(old, new)) == digest(CODE)


@pytest.mark.parametrize(("old", "new"), [("2.0", "2"), ("math", "cmath"), ("class Circle", "class Round"), ("pi *", "-pi *")])
def test_everything_else_counts(digest, old, new):
    assert digest(CODE.replace(old, new)) != digest(CODE)


@pytest.mark.parametrize("name", ["table.csv", "Snakefile", "half.py"])
def test_of_what_is_no_python_the_bytes_count(digest, name):
    assert digest("a, (\n", name) == checksum(name) != digest("a, ( # b\n", name)


def test_digests_that_are_kept_are_those_that_are_found(digest):
    found = digest(CODE)
    keep_source_digests(["module.py"])
    _kept.cache_clear()
    assert source_digest("module.py") == found == _kept()[checksum("module.py")]
    assert digest(CODE.replace("2.0", "3.0")) not in (found, *_kept().values())
