"""The prior is a probability, and spares what needs few numbers."""

from itertools import combinations

import numpy as np
import pytest
from made_problems import made_unit
from support import UR10, robot_of
from synthetic import equipped

from elastocal.diagnosis.hypotheses import OTHER, prior_of, units_of
from elastocal.diagnosis.settings import Settings
from elastocal.effects.catalogue import candidates_on

SETTINGS = Settings()


def every_model(units):
    """All sets of units with one variant at a location at most, "nothing" among them."""
    for size in range(len(units) + 1):
        for chosen in combinations(units, size):
            if len({(unit.mechanism, unit.location) for unit in chosen}) == size:
                yield chosen


def made_units():
    """Three mechanisms: at three locations, one of which has three laws; at two; and at one."""
    third = float(np.log(1 / 3))
    return (
        made_unit("harmonic", (1,), 0),
        made_unit("harmonic", (2,), 1),
        *(made_unit("harmonic", (3,), column, log_prior=third) for column in (2, 3, 4)),
        made_unit("offset", (1,), 5),
        made_unit("offset", (2,), 6),
        made_unit("link_weight", (), 7),
    )


def test_probabilities_of_all_models_sum_to_one():
    units, prior = made_units(), prior_of(made_units(), SETTINGS)
    nothing = (1 - SETTINGS.mechanism_probability) ** 2 * (1 - SETTINGS.gravity_probability)
    total = sum(nothing * np.exp(prior.log_odds_of(model)) for model in every_model(units))
    assert total == pytest.approx(1.0, abs=1e-12)


def test_each_mechanism_is_there_with_the_probability_of_the_settings():
    units, prior = made_units(), prior_of(made_units(), SETTINGS)
    odds = [({unit.mechanism for unit in model}, np.exp(prior.log_odds_of(model))) for model in every_model(units)]
    total, known = sum(value for _, value in odds), SETTINGS.mechanism_probability
    for mechanism, probability in (("harmonic", known), ("offset", known), ("link_weight", 0.5)):
        there = sum(value for mechanisms, value in odds if mechanism in mechanisms)
        assert there / total == pytest.approx(probability)


def test_the_number_of_locations_is_geometric_and_all_sets_of_so_many_are_equally_likely():
    units = made_units()[:5]
    prior = prior_of(units, SETTINGS)
    by_places = {}
    for model in every_model(units):
        places = tuple(sorted(unit.location for unit in model))
        by_places[places] = by_places.get(places, 0.0) + np.exp(prior.log_odds_of(model))
    odds = SETTINGS.mechanism_probability / (1 - SETTINGS.mechanism_probability)
    counts = [sum(value for places, value in by_places.items() if len(places) == size) / odds for size in (1, 2, 3)]
    np.testing.assert_allclose(counts, np.array([4, 2, 1]) / 7)
    for size in (1, 2, 3):
        np.testing.assert_allclose(
            [v for p, v in by_places.items() if len(p) == size], counts[size - 1] * odds / [3, 3, 1][size - 1]
        )


def test_one_mechanism_at_many_joints_costs_less_than_as_many_mechanisms():
    offsets = [made_unit("joint_offset", (joint,), joint) for joint in range(5)]
    others = [made_unit(name, (0,), 5 + number) for number, name in enumerate("abcd")]
    prior = prior_of((*offsets, *others), SETTINGS)
    assert prior.log_odds_of(offsets) > prior.log_odds_of([offsets[0], *others]) + 8


def test_adding_a_unit_changes_the_log_odds_by_what_added_says():
    units = made_units()
    prior = prior_of(units, SETTINGS)
    for model in every_model(units):
        for unit in units:
            if (unit.mechanism, unit.location) in {(one.mechanism, one.location) for one in model}:
                continue
            count = sum(one.mechanism == unit.mechanism for one in model)
            change = prior.log_odds_of((*model, unit)) - prior.log_odds_of(model)
            assert prior.added(unit, count) == pytest.approx(change)


@pytest.fixture(scope="module")
def catalogue():
    return list(candidates_on(equipped(robot_of(UR10))).values())


def test_units_of_the_catalogue_have_columns_of_their_own_that_share_out_all(catalogue):
    tried = [(c, (value,)) for c in catalogue for value in (0.1, 0.5)[: len(c.shapes) or 1]]
    tried = [(c, values if c.shapes else ()) for c, values in tried]
    tried += [(c, (0.5,)) for c in catalogue if c.shapes]
    features = [((1,), 40), ((), 48)]
    units = units_of(tried, features, SETTINGS)
    columns = np.concatenate([unit.columns for unit in units])
    np.testing.assert_array_equal(np.sort(columns), np.arange(len(columns)))
    assert [unit.location for unit in units if unit.mechanism == OTHER] == [(1,), ()]
    # Laws and shapes at one location share its probability.
    for mechanism in {unit.mechanism for unit in units} - {OTHER}:
        for place in {unit.location for unit in units if unit.mechanism == mechanism}:
            mine = [unit.log_prior for unit in units if (unit.mechanism, unit.location) == (mechanism, place)]
            assert np.exp(mine).sum() == pytest.approx(1.0), (mechanism, place)
    assert len({unit.key for unit in units}) == len(units)


def test_plausible_sizes_fall_with_the_order_of_a_harmonic_and_signs_are_those_of_physics(catalogue):
    chosen = [c for c in catalogue if c.effect in ("transmission_harmonic", "stiffening", "base_compliance")]
    units = units_of([(c, tuple(shape.start for shape in c.shapes)) for c in chosen], [], SETTINGS)
    for unit, candidate in zip(units, chosen, strict=True):
        orders = np.array([parameter.order for parameter in candidate.parameters])
        expected = [parameter.plausible for parameter in candidate.parameters] * orders**-SETTINGS.harmonic_decay
        np.testing.assert_allclose(unit.sizes, expected)
        assert unit.signs.tolist() == [parameter.sign for parameter in candidate.parameters]
    assert max(unit.sizes.max() / unit.sizes.min() for unit in units) > 1.1
    assert any(unit.signs.any() for unit in units)
