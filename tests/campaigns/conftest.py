"""Fixtures of the tests of campaigns."""

import pytest
from made_cells import Cell


@pytest.fixture
def cell(tmp_path):
    """A campaign's folder that a test changes before it is read."""
    return Cell(tmp_path)
