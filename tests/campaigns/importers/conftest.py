"""Made-up files of the two FANUC sources."""

import pytest
from made_fanuc_sources import cpa_source, static_source


@pytest.fixture
def static(fanuc, tmp_path):
    return static_source(fanuc, tmp_path)


@pytest.fixture
def cpa(fanuc, tmp_path):
    return cpa_source(fanuc, tmp_path)
