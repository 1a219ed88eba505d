"""The tool works without what proves it; the demonstration alone asks for its simulated robots."""

import re
from pathlib import Path

SOURCE = Path(__file__).resolve().parents[2] / "src"


def test_the_tool_imports_the_proof_in_its_demonstration_alone():
    """For annotations too, which import-linter leaves out."""
    importing = re.compile(r"^ *(?:from|import) elastocal_proof", re.MULTILINE)
    found = [path for path in (SOURCE / "elastocal").rglob("*.py") if importing.search(path.read_text(encoding="utf-8"))]
    assert [path.relative_to(SOURCE).as_posix() for path in found] == ["elastocal/command/demo.py"]
