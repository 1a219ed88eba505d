"""What the plant may know of elastocal: how bad input is refused and how a campaign's folder is written. Nothing else."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import elastocal.plant

FOLDER = Path(elastocal.plant.__file__).parent
MODULES = sorted(FOLDER.glob("*.py"))
ANYWHERE = {"elastocal.errors"}
# The format of a campaign is a contract of both sides; its one writer knows it.
IN_FOLDERS = {"elastocal.campaign.write_campaign", "elastocal.whole_files.appearing_whole"}


def imported(path):
    """Names of elastocal that a module imports, the function with it where it is one."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        if isinstance(node, ast.ImportFrom):
            assert node.level == 0, "relative imports hide where they lead"
            found |= {f"{node.module}.{alias.name}" for alias in node.names}
    return {name for name in found if name.split(".")[0] == "elastocal" and not name.startswith("elastocal.plant")}


@pytest.mark.parametrize("path", MODULES, ids=lambda path: path.stem)
def test_a_module_imports_nothing_of_the_analysis(path):
    allowed = {f"{name}.InputError" for name in ANYWHERE} | (IN_FOLDERS if path.stem == "folders" else set())
    assert imported(path) <= allowed


def test_making_data_loads_no_module_of_the_analysis():
    """At run time too, by whatever way of importing: all modules but the writer of folders."""
    names = [f"elastocal.plant.{path.stem}" for path in MODULES if path.stem not in ("folders", "__init__")]
    code = f"import sys, {', '.join(names)}; print(*sorted(n for n in sys.modules if n.startswith('elastocal')))"
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    assert {name for name in loaded if not name.startswith("elastocal.plant")} == {"elastocal", *ANYWHERE}


def test_no_module_of_the_analysis_imports_the_plant():
    others = [path for path in FOLDER.parent.rglob("*.py") if FOLDER not in path.parents and "blind" not in path.parts]
    assert others
    for path in others:
        assert "elastocal.plant" not in path.read_text(encoding="utf-8"), path
