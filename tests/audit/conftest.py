"""A diagnosed campaign and simulated data that audits look at."""

import pytest
from audited_campaigns import diagnosed_campaign
from made_audits import made_run


@pytest.fixture(scope="session")
def diagnosed(tmp_path_factory):
    """A campaign of springs and one bent link, with a held-out pose outside of the range; tests put back what they alter."""
    top, points = tmp_path_factory.mktemp("diagnosed"), ("3DoF", "6DoF")
    return diagnosed_campaign(top, "kuka", ("link_elasticity",), covariates=(), points=points, poses=16, held_out=6)


@pytest.fixture
def run(tmp_path):
    """Experiments and deflections of a robot of two joints."""
    return made_run(tmp_path)
