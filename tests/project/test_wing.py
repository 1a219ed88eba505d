"""The tool works without what proves it; the demonstration alone asks for its simulated robots."""

import ast
import subprocess
import sys
from pathlib import Path

SOURCE = Path(__file__).resolve().parents[2] / "src"
# As if the proof were not installed.
ALONE = """
import importlib, pkgutil, sys
sys.modules["elastocal_proof"] = None
import elastocal
print(elastocal.__name__)
for module in pkgutil.walk_packages(elastocal.__path__, "elastocal."):
    importlib.import_module(module.name)
    print(module.name)
"""


def names(file):
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield node.module


def test_the_tool_imports_the_proof_in_its_demonstration_alone():
    """For annotations too, which import-linter leaves out."""
    tool = (SOURCE / "elastocal").rglob("*.py")
    found = [file.relative_to(SOURCE).as_posix() for file in tool if any("elastocal_proof" in name for name in names(file))]
    assert found == ["elastocal/command/demo.py"]


def test_every_module_of_the_tool_is_imported_where_there_is_no_proof():
    done = subprocess.run([sys.executable, "-c", ALONE], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    files = list((SOURCE / "elastocal").rglob("*.py"))
    assert len(done.stdout.split()) == len(files)
