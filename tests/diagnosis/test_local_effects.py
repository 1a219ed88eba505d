"""Effects beyond an edge: in some poses, with shares of one prior."""

import numpy as np
import pytest

from elastocal.diagnosis.fitted_subset import fit_subset
from elastocal.diagnosis.hypotheses import LOCAL_EFFECT
from elastocal.diagnosis.local_effects import build_local_effects
from elastocal.diagnosis.settings import Settings

SETTINGS = Settings()


@pytest.fixture
def problem(cases):
    case = cases[0]
    every_row = np.ones(len(case.campaign.measurements), bool)
    declared = fit_subset(case, every_row, SETTINGS).declared
    return declared.get_conditions(case.observations.states), case.observations


def build(problem, suspects):
    conditions, observations = problem
    return build_local_effects(conditions, observations, np.array(suspects), 5e-4)


def test_each_effect_grows_beyond_its_edge_and_reaches_a_suspect(problem):
    _, observations = problem
    suspect = 5
    effects = build(problem, [suspect])
    assert effects.excess
    for excess in effects.excess:
        assert excess.max() == 1.0
        assert excess.min() == 0.0
        assert excess[observations.state[suspect]] > 0.0
        beyond = np.isin(observations.state, np.flatnonzero(excess))
        assert len(np.unique(observations.cluster[beyond])) >= 2


def test_effects_that_reach_no_suspect_are_left_out_with_their_share_of_the_prior(
    problem,
):
    _, observations = problem
    every = build(problem, np.arange(len(observations)))
    locations = len(set(every.locations))
    single = build(problem, [5])
    kept = len(set(single.locations))
    assert 0 < kept < locations
    np.testing.assert_allclose(
        sum(np.exp(every.log_priors)), locations * locations / locations
    )
    assert max(single.log_priors) <= np.log(kept / locations)


def test_terms_move_every_joint(problem):
    effects = build(problem, [5])
    joints = problem[0].joint_angles.shape[1]
    terms = effects.build_terms(7, len(SETTINGS.scales))
    assert len(effects.displacement()) == joints * len(terms)
    assert [term.columns[0] for term in terms] == [
        7 + joints * number for number in range(len(terms))
    ]
    assert {term.mechanism for term in terms} == {LOCAL_EFFECT}
