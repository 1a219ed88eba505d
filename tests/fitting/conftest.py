"""Fixtures of the tests of the model."""

import pytest
from synthetic import made_estimate, made_model, made_states, seen_exactly

from elastocal.campaigns.campaign import Target
from elastocal.effects.catalogue import candidates_on

TARGETS = (
    Target("A", "6DoF", None),
    Target("B", "3DoF", (0.1, 0.0, -0.2)),
    Target("C", "6DoF", None),
)


@pytest.fixture(params=[3, 6], ids=["positions", "poses"])
def full_case(request, fanuc):
    """Two sessions, three targets, two effects and springs that are identified; every
    parameter somewhere."""
    known = candidates_on(made_model(fanuc.chain).sites)
    effects = known["lost_motion@2"], known["link_geometry@3"]
    model = made_model(
        fanuc.chain, TARGETS, request.param, effects=effects, identified=True
    )
    estimate = made_estimate(model, (0, 4), seed=1)
    states = made_states(6, 8, seed=2, sessions=2)
    states.session[:] = 4 * states.session
    return model, estimate, seen_exactly(model, estimate, states)
