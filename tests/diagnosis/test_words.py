"""Mechanisms, locations and hypotheses are named as a robot engineer names them."""

import pytest
from support import ODD_CHAINS, OTHER_CHAINS, chain_of
from synthetic import equipped

from elastocal.diagnosis.findings import location_words
from elastocal.diagnosis.words import (
    UNKNOWN,
    alternative_words,
    candidate_words,
    effect_words,
    found_words,
    hypotheses_words,
    hypothesis_words,
    in_common,
    in_words,
)
from elastocal.effects.catalogue import candidates_on, effects
from elastocal.figures.candidates import short_name


def test_every_effect_of_the_catalogue_brings_its_own_physical_name():
    named = {name: effect.words for name, effect in effects().items()}
    assert all(named.values()), [name for name, words in named.items() if not words]
    assert len(set(named.values())) == len(named)
    assert not [words for words in named.values() if "_" in words or words != words.strip() or words[0].isupper()]


@pytest.mark.parametrize("chain", [*OTHER_CHAINS.values(), *ODD_CHAINS.values()])
def test_no_two_candidates_are_printed_alike(chain):
    keys = list(candidates_on(equipped(chain_of(chain))))
    for printed in (candidate_words, short_name):
        assert len({printed(key) for key in keys}) == len(keys)


@pytest.mark.parametrize(
    ("effect", "locations", "expected"),
    [
        ("link_weight", ["joint 2"], "gravity sag of joint 2"),
        ("joint_offset", ["joint 3", "joint 2"], "zero offset of joints 2 and 3"),
        ("link_elasticity", ["links 1 and 2 and 6 one section"], "of links 1, 2 and 6 (all of one cross-section)"),
        ("link_elasticity", ["column", "link 2"], "of the column and of link 2"),
        ("cross_compliance", ["joints 2 and 3", "joints 4 and 5"], "elastic coupling of joints 2 and 3 and of joints 4 and 5"),
        ("transmission_harmonic", ["joint 4 orders 1-2", "joint 4 orders 3-6"], "of joint 4 (orders 1-2, orders 3-6)"),
        ("transmission_harmonic", [f"joint {k} orders 1-2" for k in (4, 2, 10)], "error of joints 2, 4 and 10"),
        (
            "link_weight",
            ["off the line", "joint 5"],
            "gravity sag of the whole arm (centres of mass off the links' axes) and of joint 5",
        ),
        ("link_weight", ["joint 5", ""], "gravity sag of joint 5 and of the whole arm"),
        ("payload", [""], "weight of an undeclared payload"),
        ("payload", [], "weight of an undeclared payload"),
    ],
)
def test_locations_are_gathered(effect, locations, expected):
    assert effect_words(effect, locations).endswith(expected)


def test_locations_are_read_as_findings_write_them():
    assert (
        effect_words("cross_compliance", [location_words("cross_compliance", (2, 3))]) == "elastic coupling of joints 2 and 3"
    )
    written = location_words("link_elasticity", (1, 2, "one section"))
    assert effect_words("link_elasticity", [written]) == found_words("link_elasticity", ["link_elasticity@1+2[one section]"])


@pytest.mark.parametrize(
    ("key", "expected"),
    [
        ("lost_motion@3", "lost motion (backlash) of joint 3"),
        ("transmission_harmonic@1[orders 1-2]", "gear transmission error of joint 1 (orders 1-2)"),
        ("force_bias[base axes]", "zero error of the force sensor (base axes)"),
        ("link_elasticity[column]", "elastic bending and torsion of the column"),
    ],
)
def test_candidates_are_named_in_words(key, expected):
    assert candidate_words(key) == expected


def test_other_is_unknown_alone_and_related_beside_a_mechanism():
    assert hypothesis_words(["other"], {"other": ["joint 2"]}) == UNKNOWN == "something that the catalogue does not have"
    assert hypothesis_words(["link_weight", "other"], {"link_weight": ["joint 2"]}) == (
        "gravity sag of joint 2 or a related mechanism"
    )
    assert hypothesis_words([]) == "nothing is missing"
    assert (alternative_words("other"), alternative_words("payload")) == (
        "a related mechanism",
        "weight of an undeclared payload",
    )


def test_hypotheses_that_hold_the_first_are_told_by_what_they_add():
    sets = [["link_weight"], ["link_weight", "other"], ["joint_offset", "link_weight"], ["joint_offset"], []]
    assert hypotheses_words([{"mechanisms": names, "locations": {"link_weight": ["joint 2"]}} for names in sets]) == [
        "gravity sag of joint 2",
        "the same or a related mechanism",
        "the same with zero offset",
        "zero offset",
        "nothing is missing",
    ]
    # Beside "nothing" all are told in full.
    assert hypotheses_words([{"mechanisms": names, "locations": {}} for names in ([], ["joint_offset"])])[1] == "zero offset"


def test_keys_in_a_sentence_become_words_and_common_words_stay():
    said = in_words("link_weight@2: mass is 4 kg, beyond the rated payload of 3 kg; the step 'with joint_offset' raised it")
    assert said.startswith("gravity sag of joint 2: mass is 4 kg, beyond the rated payload of 3 kg;")
    assert said.endswith("; the step 'with zero offset' raised it")
    assert in_words("payload: mass is -3 kg") == "weight of an undeclared payload: mass is -3 kg"
    said = in_words("transmission_ratio@3: per_q3 is -0.0042 rad/rad, more than 3 times what such an effect reaches")
    assert said.startswith("gear ratio or coupling error of joint 3: per movement of joint 3 is -0.0042 rad/rad, more than")


def test_every_family_of_the_catalogue_has_a_kind():
    assert all(in_common(name, []) for name in effects())
