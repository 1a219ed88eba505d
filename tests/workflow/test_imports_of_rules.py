"""Functions that rules import, or name as their step, exist.

Type checkers do not read rules, and Snakemake reports a wrong step only when its job runs.
"""

import re
from importlib import import_module
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
RULES = [ROOT / "Snakefile", *sorted((ROOT / "workflow" / "rules").glob("*.smk"))]
IMPORT = re.compile(r"^\s*from (elastocal[\w.]*) import (\([^)]*\)|.*)", re.MULTILINE)
STEP = re.compile(r'step="([\w.]+)\.(\w+)"')


def imported_names(text):
    """List modules and names that a file of rules takes from the packages."""
    names = STEP.findall(text)
    for module, imported in IMPORT.findall(text):
        names += [(module, name) for name in re.findall(r"\w+", imported)]
    return names


@pytest.mark.parametrize("file", RULES, ids=lambda file: file.name)
def test_every_name_that_a_rule_uses_exists(file):
    names = imported_names(file.read_text(encoding="utf-8"))
    absent = [
        f"{module}.{name}"
        for module, name in names
        if not hasattr(import_module(module), name)
    ]
    assert absent == []


def test_steps_and_imports_are_found():
    text = "\n".join(file.read_text(encoding="utf-8") for file in RULES)
    assert len(imported_names(text)) > 40
