"""The tool works without what proves it; the demonstration alone asks for its simulated robots."""

import ast
from pathlib import Path

SOURCE = Path(__file__).resolve().parents[2] / "src"


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
