"""A diagnosed campaign and simulated data that audits look at."""

import pytest
from audited_campaigns import diagnosed_campaign
from made_audits import make_run


@pytest.fixture(scope="session")
def diagnosed(tmp_path_factory):
    """A campaign of springs at two points; tests put back what they alter."""
    return diagnosed_campaign(
        tmp_path_factory.mktemp("diagnosed"),
        "kuka",
        covariates=(),
        points=("3DoF", "6DoF"),
    )


@pytest.fixture
def run(tmp_path):
    """Experiments, deflections and estimates of a robot of two joints."""
    return make_run(tmp_path)
