"""Fixtures: a campaign's folder that a test spoils before it reads it."""

import pytest
from made_cells import Cell


@pytest.fixture
def cell(tmp_path):
    return Cell(tmp_path)
