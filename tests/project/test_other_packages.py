"""The comparison with other packages is one of the scripts and versions that are here."""

import ast
import tomllib
from pathlib import Path

import pandas as pd
import pytest

ROOT = Path(__file__).resolve().parents[2]
SCRIPTS = ROOT / "benchmarks" / "peers"
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))


def read_table():
    """Read the table of the page that benchmarks/peers/run.py writes."""
    page = (ROOT / "docs" / "other_packages_tables.md").read_text("utf-8")
    lines = [line for line in page.splitlines() if line.startswith("|")]
    header, _, *rows = map(split_row, lines)
    return pd.DataFrame(rows, columns=header)


def split_row(line):
    return [cell.strip() for cell in line.split("|")]


TABLE = read_table()


@pytest.mark.parametrize("package", ["robotkinecal", "pybotics", "figaroh"])
def test_the_table_is_of_the_versions_that_are_pinned(package):
    (version,) = TABLE.version[TABLE.package == package]
    groups = PROJECT["dependency-groups"]
    assert groups[f"peer-{package}"] == [f"{package}=={version}"]


@pytest.mark.parametrize("package", sorted({*TABLE.package}))
def test_the_table_has_the_lines_of_each_script(package):
    source = (SCRIPTS / f"{package}_ur5.py").read_text("utf-8")
    (predict,) = (
        node
        for node in ast.parse(source).body
        if getattr(node, "name", "") == "predict"
    )
    first, *_, last = predict.body[1:]
    lines = source.splitlines()[first.lineno - 1 : last.end_lineno]
    stated = {*TABLE.lines[TABLE.package == package]}
    assert stated == {str(sum(bool(line.strip()) for line in lines))}
