"""A diagnosed campaign that audits look at."""

import pytest
from audited_campaigns import diagnosed_campaign


@pytest.fixture(scope="session")
def diagnosed(tmp_path_factory):
    """A campaign of springs and one bent link, with a held-out pose outside of the range; tests put back what they alter."""
    top, points = tmp_path_factory.mktemp("diagnosed"), ("3DoF", "6DoF")
    return diagnosed_campaign(top, "kuka", ("link_elasticity",), covariates=(), points=points, poses=16, held_out=6)
