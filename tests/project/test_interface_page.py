"""Every name that the page of the programming interface lists exists."""

import runpy
from pathlib import Path

FILE = Path(__file__).resolve().parents[2] / "docs" / "site" / "interface.py"


def test_every_name_of_the_interface_page_exists():
    """The page looks up each name; only a slow test builds the whole site."""
    page = runpy.run_path(str(FILE))["page"]
    assert page().count(".. auto") > 15
