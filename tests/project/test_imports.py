"""What jobs and commands may load before they need it, a third of a job of the study;
and the tool never loads its proof."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from elastocal.command.main import COMMANDS

TOP = Path(__file__).resolve().parents[2]
_NEVER = {
    "matplotlib",
    "mujoco",
    "scipy.optimize",
    "scipy.stats",
    "sklearn",
    "snakemake",
    "statsmodels",
}
_BY_DOCUMENTS = {"jsonschema", "rich", "typer"}
_OF_STUDY = _NEVER | _BY_DOCUMENTS | {"pandas", "scipy.spatial", "scipy.linalg", "yaml"}
# Modules whose functions are steps of rules, and the packages that none of them loads.
SCRIPTS = {
    "study": (
        "elastocal.study.equation_11 elastocal.study.evaluation elastocal.study.simulation",
        _OF_STUDY | {"scipy"},
    ),
    "questions": (
        "elastocal.study.ladder elastocal.study.points",
        _OF_STUDY | {"scipy"},
    ),
    "reading": (
        "elastocal.loop.loading",
        _NEVER | {"jsonschema", "pandas", "rich", "typer", "scipy"},
    ),
    "loop": (
        "elastocal.loop.diagnosis_tables elastocal.loop.whole",
        _NEVER | _BY_DOCUMENTS | {"pandas"},
    ),
    "blind": ("elastocal_proof.blind.verdicts", _NEVER | _BY_DOCUMENTS | {"pandas"}),
}
_HELP = """
from contextlib import redirect_stdout, suppress
from elastocal.command.main import app
for words in {commands}:
    with redirect_stdout(None), suppress(SystemExit):
        app([*words, "--help"])
"""


def loaded(code):
    """Modules that a fresh process has once it has run some code."""
    code += "\nimport sys\nprint(*sys.modules)"
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=TOP,
        capture_output=True,
        text=True,
        check=True,
    )
    return set(done.stdout.split())


@pytest.mark.parametrize(("scripts", "never"), SCRIPTS.values(), ids=SCRIPTS)
def test_a_job_starts_without_what_it_does_not_need(scripts, never):
    found = loaded(
        f"import sys\nsys.path.insert(0, 'workflow/scripts')\nimport job, {scripts.replace(' ', ', ')}"
    )
    assert {"elastocal", "numpy", "pyarrow"} <= found
    assert not found & never


def test_help_is_given_without_anything_that_computes():
    commands = [
        [],
        ["import"],
        *(["import", name] for name in ("urdf", "dh", "csv")),
        *([c.__name__] for c in COMMANDS),
    ]
    found = loaded(_HELP.format(commands=commands))
    assert "elastocal.command.main" in found
    assert not found & (_OF_STUDY - {"typer"} | {"numpy", "pyarrow", "scipy"})


def test_a_table_is_written_and_read_without_pandas(tmp_path):
    """PyArrow would import it for the first array, and where it turns one into
    numpy's."""
    found = loaded(f"""
import numpy as np
from elastocal.io.storage import Column, TableSchema, read_table, write_table
kinds = {{"int32": [1, 2], "float64": [0.5, 2.0], "float32": [0.5, 2.0], "bool": [True, False], "string": ["µ", "b"]}}
schema = TableSchema("made", tuple(Column(name, name, "", "made") for name in kinds))
write_table({str(tmp_path / "made.parquet")!r}, schema, [kinds], {{"robot": "kuka"}})
read = read_table({str(tmp_path / "made.parquet")!r}, schema)
assert {{name: values.tolist() for name, values in read.items()}} == kinds
""")
    assert "elastocal.io.storage" in found
    assert not found & _OF_STUDY


def test_the_tool_imports_the_proof_in_its_demonstration_alone():
    """For annotations too, which import-linter leaves out."""
    importing = re.compile(r"^ *(?:from|import) elastocal_proof", re.MULTILINE)
    found = [
        path
        for path in (TOP / "src/elastocal").rglob("*.py")
        if importing.search(path.read_text(encoding="utf-8"))
    ]
    assert [path.relative_to(TOP).as_posix() for path in found] == [
        "src/elastocal/command/demo.py"
    ]
