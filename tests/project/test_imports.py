"""Jobs and commands load no library before they need it.

Libraries took a third of a job of the study. The tool does not load its proof.
"""

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
# Modules with steps of rules, and the packages that they must not load.
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


def list_loaded_modules(code):
    """List the modules that are loaded in a new process after it has run some code."""
    code += "\nimport sys\nprint(*sys.modules)"
    finished = subprocess.run(
        [sys.executable, "-c", code],
        cwd=TOP,
        capture_output=True,
        text=True,
        check=True,
    )
    return set(finished.stdout.split())


@pytest.mark.parametrize(("scripts", "never"), SCRIPTS.values(), ids=SCRIPTS)
def test_a_job_starts_without_what_it_does_not_need(scripts, never):
    modules = ", ".join(["job", *scripts.split()])
    loaded = list_loaded_modules(
        f"import sys\nsys.path.insert(0, 'workflow/scripts')\nimport {modules}"
    )
    assert {"elastocal", "numpy", "pyarrow"} <= loaded
    assert not loaded & never


def test_help_loads_no_library_that_computes():
    commands = [
        [],
        ["import"],
        *(["import", name] for name in ("urdf", "dh", "csv")),
        *([command.__name__] for command in COMMANDS),
    ]
    loaded = list_loaded_modules(_HELP.format(commands=commands))
    assert "elastocal.command.main" in loaded
    assert not loaded & (_OF_STUDY - {"typer"} | {"numpy", "pyarrow", "scipy"})


def test_a_table_is_written_and_read_without_pandas(tmp_path):
    """PyArrow imports pandas for its first array, and to convert one to numpy."""
    loaded = list_loaded_modules(f"""
import numpy as np
from elastocal.io.storage import Column, TableSchema, read_table, write_table
kinds = {{"int32": [1, 2], "float64": [0.5, 2.0], "float32": [0.5, 2.0]}}
kinds |= {{"bool": [True, False], "string": ["µ", "b"]}}
schema = TableSchema("made", tuple(Column(name, name, "", "made") for name in kinds))
write_table({str(tmp_path / "made.parquet")!r}, schema, [kinds], {{"robot": "kuka"}})
read = read_table({str(tmp_path / "made.parquet")!r}, schema)
assert {{name: values.tolist() for name, values in read.items()}} == kinds
""")
    assert "elastocal.io.storage" in loaded
    assert not loaded & _OF_STUDY


def test_only_the_demonstration_of_the_tool_imports_the_proof():
    """Annotations count too, which import-linter leaves out."""
    importing = re.compile(r"^ *(?:from|import) elastocal_proof", re.MULTILINE)
    files = [
        path
        for path in (TOP / "src/elastocal").rglob("*.py")
        if importing.search(path.read_text(encoding="utf-8"))
    ]
    assert [path.relative_to(TOP).as_posix() for path in files] == [
        "src/elastocal/command/demo.py"
    ]
