"""Every name that the page of the programming interface lists exists, and the examples
in Python run."""

import re
import runpy
from pathlib import Path

import elastocal

DOCS = Path(__file__).resolve().parents[2] / "docs"
FILE = DOCS / "site" / "interface.py"
HOW_TO = DOCS / "how_to" / "use_from_python.md"


def test_every_name_of_the_interface_page_exists():
    """The page looks up each name; only a slow test builds the whole site."""
    page = runpy.run_path(str(FILE))["page"]
    assert page().count(".. auto") > 15


def test_interface_page_has_every_public_name():
    """Types that others return are explained where these are."""
    returned = {"__version__", "Conformity", "Effect", "Overview", "Robot", "Verdict"}
    names = {*elastocal.__all__} - returned - {"read_verdict"}
    page = runpy.run_path(str(FILE))["page"]()
    listed = {match.rpartition(".")[2] for match in re.findall(r":: (\S+)", page)}
    assert names <= listed, names - listed


def test_examples_of_the_how_to_page_run_from_top_to_bottom(
    tmp_path, monkeypatch, capsys, blank_figures
):
    examples = re.findall(r"```python\n(.*?)```", HOW_TO.read_text("utf-8"), re.DOTALL)
    assert len(examples) == 5
    monkeypatch.chdir(tmp_path)
    exec("\n".join(examples), {"__name__": "__main__"})
    assert "zero offset of joint 2" in capsys.readouterr().out
    assert (tmp_path / "report.pdf").is_file()
