"""Fixtures of the tests of fitting."""

import pytest
from synthetic import make_estimate, make_model, make_states, observe_exactly

from elastocal.campaigns.campaign import Target
from elastocal.effects.catalogue import candidates_on

TARGETS = (
    Target("A", "6DoF", None),
    Target("B", "3DoF", (0.1, 0.0, -0.2)),
    Target("C", "6DoF", None),
)


@pytest.fixture(params=[3, 6], ids=["positions", "poses"])
def full_case(request, fanuc):
    """A model with every kind of parameter, an estimate and exact observations: two
    sessions, three targets, two effects and identified joint compliances."""
    candidates = candidates_on(make_model(fanuc.chain).sites)
    effects = candidates["lost_motion@2"], candidates["link_geometry@3"]
    model = make_model(
        fanuc.chain, TARGETS, request.param, effects=effects, identified=True
    )
    estimate = make_estimate(model, (0, 4), seed=1)
    states = make_states(6, 8, seed=2, sessions=2)
    states.session[:] = 4 * states.session
    return model, estimate, observe_exactly(model, estimate, states)
