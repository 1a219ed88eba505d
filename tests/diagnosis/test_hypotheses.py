"""The prior is a probability, and spares what needs few numbers."""

from itertools import combinations

import numpy as np
import pytest
from made_problems import made_unit
from support import UR10, robot_of
from synthetic import equipped

from elastocal.diagnosis.discrepancy import FORCE, NEIGHBOURS, OWN, Discrepancy
from elastocal.diagnosis.hypotheses import OTHER, build_model_prior, build_terms
from elastocal.diagnosis.settings import Settings
from elastocal.effects.catalogue import candidates_on

SETTINGS = Settings()


THIRD = float(np.log(1 / 3))
# A mechanism at three locations, one of which has three laws.
UNITS = (
    made_unit("harmonic", (1,), 0),
    made_unit("harmonic", (2,), 1),
    *(made_unit("harmonic", (3,), column, log_prior=THIRD) for column in (2, 3, 4)),
)


def test_the_number_of_locations_is_geometric_and_all_sets_of_so_many_are_equally_likely():
    """Given that a mechanism is there; laws share a location. And what a unit adds is
    the difference of both models."""
    prior = build_model_prior(
        [*UNITS, made_unit(OTHER, (1,), 5), made_unit(OTHER, (1,), 6, law=NEIGHBOURS)],
        SETTINGS,
    )
    by_places = {}
    for size in range(1, 4):
        for model in combinations(UNITS, size):
            places = tuple(sorted({unit.location for unit in model}))
            if len(places) == size:
                odds = prior.compute_log_odds(model)
                by_places[places] = by_places.get(places, 0.0) + np.exp(odds)
                smaller = prior.compute_log_odds(model[:-1])
                assert prior.log_odds_change(model[-1], size - 1) == pytest.approx(
                    odds - smaller
                )
    there = SETTINGS.mechanism_probability / (1 - SETTINGS.mechanism_probability)
    expected = {
        places: there * {1: 4 / 7 / 3, 2: 2 / 7 / 3, 3: 1 / 7}[len(places)]
        for places in by_places
    }
    assert len(by_places) == 7 and by_places == pytest.approx(expected)
    # Laws of the competitor have places of their own, and its own probability.
    other = [made_unit(OTHER, (1,), 5), made_unit(OTHER, (1,), 6, law=NEIGHBOURS)]
    odds = SETTINGS.other_probability / (1 - SETTINGS.other_probability)
    assert np.exp(prior.compute_log_odds(other)) == pytest.approx(odds / 3)


@pytest.fixture(scope="module")
def catalogue():
    return list(candidates_on(equipped(robot_of(UR10))).values())


def test_units_of_the_catalogue_have_columns_of_their_own_that_share_out_all(catalogue):
    tried = [
        (
            c,
            [(float(value),) for shape in c.shapes for value in shape.values(3)]
            or [()],
        )
        for c in catalogue
    ]
    at_joints = [
        Discrepancy((joint,), cause, 1.0, (), 40)
        for joint, cause in ((1, OWN), (1, NEIGHBOURS), (2, OWN))
    ]
    laws = [
        at_joints[0],
        at_joints[1],
        Discrepancy((), f"{FORCE} shift", 1.0, (), 24),
        at_joints[2],
    ]
    units = build_terms(tried, laws, SETTINGS)
    columns = np.concatenate([unit.columns for unit in units])
    np.testing.assert_array_equal(np.sort(columns), np.arange(len(columns)))
    against = [unit for unit in units if unit.mechanism == OTHER]
    assert [(unit.discrepancy, len(unit.columns)) for unit in against] == [
        (law, law.features) for law in laws
    ]
    assert not any(unit.discrepancy for unit in units if unit.candidate)
    # Laws and shapes at one location share its probability; laws of the competitor have
    # places of their own.
    for place in {unit.slot for unit in units if unit.candidate}:
        assert np.exp(
            [unit.log_prior for unit in units if unit.slot == place]
        ).sum() == pytest.approx(1.0), place
    assert len({unit.slot for unit in against}) == len(laws)
    # Their kinds are equally likely, however many locations each has.
    assert np.exp([unit.log_prior for unit in against]) == pytest.approx(
        len(laws) / 3 / np.array([2, 1, 1, 2])
    )


def test_plausible_sizes_fall_with_the_order_of_a_harmonic_and_signs_are_those_of_physics(
    catalogue,
):
    chosen = [
        c
        for c in catalogue
        if c.effect in ("transmission_harmonic", "stiffening", "base_compliance")
    ]
    units = build_terms(
        [(c, [tuple(shape.start for shape in c.shapes)]) for c in chosen], [], SETTINGS
    )
    for unit, candidate in zip(units, chosen, strict=True):
        orders = np.array([parameter.order for parameter in candidate.parameters])
        expected = [
            parameter.plausible for parameter in candidate.parameters
        ] * orders**-SETTINGS.harmonic_decay
        np.testing.assert_allclose(unit.sizes, expected)
        assert unit.signs.tolist() == [
            parameter.sign for parameter in candidate.parameters
        ]
    assert max(unit.sizes.max() / unit.sizes.min() for unit in units) > 1.1
    assert any(unit.signs.any() for unit in units)
