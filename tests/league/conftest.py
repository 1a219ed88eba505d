"""A small data set of the league."""

import pytest
from made_leagues import made_data_set


@pytest.fixture(scope="session")
def data(kuka, config_folder, tmp_path_factory):
    return made_data_set(tmp_path_factory.mktemp("data_set"), kuka, config_folder / "robots")
