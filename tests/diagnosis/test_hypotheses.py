"""The prior is a probability, and the terms of the catalogue share it out."""

from itertools import combinations

import numpy as np
import pytest
from made_problems import make_term
from support import UR10, robot_of
from synthetic import equipped

from elastocal.diagnosis import hypotheses
from elastocal.diagnosis.discrepancy import FORCE, NEIGHBOURS, OWN, Discrepancy
from elastocal.diagnosis.hypotheses import (
    GROSS_ERROR,
    OTHER,
    build_model_prior,
    build_terms,
)
from elastocal.diagnosis.settings import Settings
from elastocal.effects.catalogue import candidates_on

SETTINGS = Settings()
THIRD = float(np.log(1 / 3))
# A mechanism at three locations, one of which has three variants.
TERMS = (
    make_term("harmonic", (1,), 0),
    make_term("harmonic", (2,), 1),
    *(make_term("harmonic", (3,), column, log_prior=THIRD) for column in (2, 3, 4)),
)
DISCREPANCIES = (
    make_term(OTHER, (1,), 5),
    make_term(OTHER, (1,), 6, law=NEIGHBOURS),
)
PRIOR = build_model_prior([*TERMS, *DISCREPANCIES], SETTINGS)


def models_of_one_term_a_location():
    """All models of the mechanism, each with the set of its locations."""
    for size in range(1, 4):
        for model in combinations(TERMS, size):
            locations = tuple(sorted({term.location for term in model}))
            if len(locations) == size:
                yield model, locations


def odds_of(probability):
    return probability / (1 - probability)


def test_the_number_of_locations_is_geometric_and_equally_large_sets_are_equally_likely():
    """Variants share the probability of their location."""
    odds = {}
    for model, locations in models_of_one_term_a_location():
        model_odds = np.exp(PRIOR.compute_log_odds(model))
        odds[locations] = odds.get(locations, 0.0) + model_odds
    share_of_a_set = {1: 4 / 7 / 3, 2: 2 / 7 / 3, 3: 1 / 7}
    presence = odds_of(SETTINGS.mechanism_probability)
    expected = {
        locations: presence * share_of_a_set[len(locations)] for locations in odds
    }
    assert len(odds) == 7
    assert odds == pytest.approx(expected)


def test_a_term_changes_the_log_odds_by_the_difference_of_both_models():
    for model, locations in models_of_one_term_a_location():
        larger = PRIOR.compute_log_odds(model)
        smaller = PRIOR.compute_log_odds(model[:-1])
        change = PRIOR.log_odds_change(model[-1], len(locations) - 1)
        assert change == pytest.approx(larger - smaller)


def test_discrepancies_have_slots_and_a_probability_of_their_own():
    odds = np.exp(PRIOR.compute_log_odds(DISCREPANCIES))
    assert odds == pytest.approx(odds_of(SETTINGS.other_probability) / 3)


@pytest.fixture(scope="module")
def catalogue():
    return list(candidates_on(equipped(robot_of(UR10))).values())


JOINT_DISCREPANCIES = [
    Discrepancy((joint,), cause, 1.0, (), 40)
    for joint, cause in ((1, OWN), (1, NEIGHBOURS), (2, OWN))
]
BASE_DISCREPANCY = Discrepancy((), f"{FORCE} shift", 1.0, (), 24)
ALL_DISCREPANCIES = [
    *JOINT_DISCREPANCIES[:2],
    BASE_DISCREPANCY,
    JOINT_DISCREPANCIES[2],
]


@pytest.fixture(scope="module")
def terms(catalogue):
    """Terms of the catalogue with three values of each shape, and of discrepancies."""
    shape_values = []
    for candidate in catalogue:
        values = [
            (float(value),) for shape in candidate.shapes for value in shape.values(3)
        ]
        shape_values.append((candidate, values or [()]))
    return build_terms(shape_values, ALL_DISCREPANCIES, SETTINGS)


def test_laws_not_linear_in_the_load_have_a_term_at_the_masses_of_the_file_too(
    catalogue,
):
    """Both are equally probable beforehand, and share what one would have alone."""
    values = []
    for candidate in catalogue:
        if candidate.key in ("lost_motion@2", "joint_offset@2"):
            start = tuple(shape.start for shape in candidate.shapes)
            values.append((candidate, [start]))
    alone = build_terms(values, [], SETTINGS)
    terms = build_terms(values, [], SETTINGS, has_masses=True)
    evaluated = [(term.mechanism, term.at_declared_masses) for term in terms]
    assert sorted(evaluated) == [
        ("joint_offset", False),
        ("lost_motion", False),
        ("lost_motion", True),
    ]
    columns = np.concatenate([term.columns for term in terms])
    np.testing.assert_array_equal(columns, np.arange(3))
    for term in alone:
        shares = [
            np.exp(evaluated_term.log_prior)
            for evaluated_term in terms
            if evaluated_term.mechanism == term.mechanism
        ]
        assert sum(shares) == pytest.approx(np.exp(term.log_prior))


def test_terms_share_out_all_columns(terms):
    columns = np.concatenate([term.columns for term in terms])
    np.testing.assert_array_equal(np.sort(columns), np.arange(len(columns)))


def test_a_discrepancy_has_a_column_for_each_feature(terms):
    competitors = [term for term in terms if term.mechanism == OTHER]
    assert [term.discrepancy for term in competitors] == ALL_DISCREPANCIES
    for term in competitors:
        assert len(term.columns) == term.discrepancy.features
    assert not any(term.discrepancy for term in terms if term.candidate)


def test_variants_share_the_probability_of_their_location(terms):
    probabilities = {}
    for term in terms:
        if term.candidate:
            share = np.exp(term.log_prior)
            probabilities[term.slot] = probabilities.get(term.slot, 0.0) + share
    for slot, probability in probabilities.items():
        assert probability == pytest.approx(1.0), slot


def test_kinds_of_discrepancies_are_equally_likely_however_many_locations_they_have(
    terms,
):
    competitors = [term for term in terms if term.mechanism == OTHER]
    assert len({term.slot for term in competitors}) == len(ALL_DISCREPANCIES)
    shares = np.exp([term.log_prior for term in competitors])
    locations = np.array([2, 1, 1, 2])
    kinds = 3
    assert shares == pytest.approx(len(ALL_DISCREPANCIES) / kinds / locations)


def test_plausible_sizes_fall_with_the_order_of_a_harmonic_and_signs_are_those_of_physics(
    catalogue,
):
    effects = ("transmission_harmonic", "stiffening", "base_compliance")
    candidates = [candidate for candidate in catalogue if candidate.effect in effects]
    shape_values = []
    for candidate in candidates:
        start = tuple(shape.start for shape in candidate.shapes)
        shape_values.append((candidate, [start]))
    terms = build_terms(shape_values, [], SETTINGS)
    for term, candidate in zip(terms, candidates, strict=True):
        orders = np.array([parameter.order for parameter in candidate.parameters])
        plausible = np.array([p.plausible for p in candidate.parameters])
        expected = plausible * orders**-SETTINGS.harmonic_decay
        np.testing.assert_allclose(term.sizes, expected)
        assert term.signs.tolist() == [p.sign for p in candidate.parameters]
    assert max(term.sizes.max() / term.sizes.min() for term in terms) > 1.1
    assert any(term.signs.any() for term in terms)


@pytest.mark.parametrize("length", [1, 10, 100])
def test_the_prior_probability_of_nothing_does_not_depend_on_the_catalogue(
    length, monkeypatch
):
    """With independent mechanisms, one of a hundred would nearly always act."""
    names = [f"mechanism {number}" for number in range(length)]
    monkeypatch.setattr(hypotheses, "list_effects", lambda: dict.fromkeys(names))
    terms = [make_term(name, (1,), column) for column, name in enumerate(names)]
    other = make_term(OTHER, (1,), length)
    prior = build_model_prior([*terms, other], SETTINGS)
    log_odds = [prior.compute_log_odds([term]) for term in [*terms, other]]
    # The sum over all sets of mechanisms is a product.
    any_odds = np.prod(1.0 + np.exp(log_odds)) - 1.0
    any_odds *= np.exp(prior.correct_for_nothing([other]))
    assert 1.0 / (1.0 + any_odds) == pytest.approx(SETTINGS.nothing_probability)
    assert prior.correct_for_nothing([]) == 0.0
    assert prior.correct_for_nothing([make_term(GROSS_ERROR, ("row", 1), 0)]) == 0.0
