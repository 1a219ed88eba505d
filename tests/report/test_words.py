"""Effects, locations, hypotheses, numbers and units are written as a robot engineer does."""

import pytest

from elastocal.effects.catalogue import list_bundled_effects
from elastocal.report.words import (
    UNKNOWN,
    find_common_kind,
    format_alternative,
    format_hypotheses,
    format_length,
    format_located_effect,
    format_location,
    format_millimetres,
    format_number,
    format_probability,
    format_with_unit,
    join_items,
)
from elastocal.verdict import MechanismSet


def test_every_effect_of_the_catalogue_has_a_physical_name_and_a_kind():
    named = {name: effect.words for name, effect in list_bundled_effects().items()}
    assert all(named.values()) and len(set(named.values())) == len(named)
    for name in named.values():
        assert "_" not in name and name == name.strip() and not name[0].isupper()
    assert all(find_common_kind(name, []) for name in list_bundled_effects())


@pytest.mark.parametrize(
    ("effect", "locations", "expected"),
    [
        ("link_weight", ["joint 2"], "gravity sag of joint 2"),
        ("joint_offset", ["joint 3", "joint 2"], "zero offset of joints 2 and 3"),
        (
            "link_elasticity",
            ["links 1 and 2 and 6 one section"],
            "of links 1, 2 and 6 (one cross-section)",
        ),
        ("link_elasticity", ["column", "link 2"], "of the column and of link 2"),
        (
            "cross_compliance",
            ["joints 2 and 3", "joints 4 and 5"],
            "elastic coupling of joints 2 and 3 and of joints 4 and 5",
        ),
        (
            "transmission_harmonic",
            ["joint 4 orders 1-2", "joint 4 orders 3-6"],
            "of joint 4 (orders 1-2, orders 3-6)",
        ),
        (
            "transmission_harmonic",
            ["joint 4 orders 1-2", "joint 2 orders 3-6"],
            "(orders 1-2) and of joint 2 (orders 3-6)",
        ),
        (
            "transmission_harmonic",
            [f"joint {k} orders 1-2" for k in (4, 2, 10)],
            "error of joints 2, 4 and 10",
        ),
        (
            "link_weight",
            ["off the line", "joint 5"],
            "of the whole arm (centres of mass off the links' axes) and of joint 5",
        ),
        ("payload", [""], "weight of an undeclared payload"),
    ],
)
def test_locations_of_an_effect_are_joined(effect, locations, expected):
    assert format_located_effect(effect, locations).endswith(expected)


def test_a_location_is_written_without_its_effect():
    assert format_location("joint_offset", "joint 3") == "joint 3"
    assert format_location("payload", "") == "the whole robot"


def test_a_hypothesis_that_contains_the_first_one_is_described_by_what_it_adds():
    sets = [
        ["link_weight"],
        ["link_weight", "other"],
        ["joint_offset", "link_weight"],
        ["joint_offset"],
        [],
        ["other"],
    ]
    assert format_hypotheses(
        [
            MechanismSet(tuple(names), 0.1, {"link_weight": ("joint 2",)})
            for names in sets
        ]
    ) == [
        "gravity sag of joint 2",
        "the same or a related mechanism",
        "the same with zero offset",
        "zero offset",
        "nothing is missing",
        UNKNOWN,
    ]
    # If the first hypothesis is "nothing", the others are described in full.
    assert (
        format_hypotheses(
            [MechanismSet(names, 0.5, {}) for names in ((), ("joint_offset",))]
        )[1]
        == "zero offset"
    )
    assert (format_alternative("other"), format_alternative("payload"))[
        0
    ] == "a related mechanism"


@pytest.mark.parametrize(
    ("value", "error", "unit", "expected"),
    [
        (1.176e-4, 3.64e-6, "rad", ("117.6 ± 3.6", "µrad")),
        (1.5365e-7, 2.678e-9, "1/(N m^2)", ("(1.537 ± 0.027) · 10⁻⁷", "1/(N·m²)")),
        (-1.588e-4, 8.2e-6, "rad kg/(N m)", ("−158.8 ± 8.2", "µrad·kg/(N·m)")),
        (2.0e-13, None, "rad/(N m)^3", ("2.000 · 10⁻⁷", "µrad/(N·m)³")),
        (0.0012, 0.0001, "m", ("1.20 ± 0.10", "mm")),
        (0.02, 0.001, "1", ("0.0200 ± 0.0010", "")),
        (0.0, 0.0, "rad", ("0", "µrad")),
        (2e-4, 1e-5, "rad/rad", ("(2.00 ± 0.10) · 10⁻⁴", "rad/rad")),
        (-4e-8, 1e-4, "m", ("0 ± 100", "µm")),
    ],
)
def test_values_have_suitable_units(value, error, unit, expected):
    assert format_with_unit(value, error, unit) == expected


def test_probabilities_lengths_and_lists_are_written_as_in_sentences():
    probabilities = [
        format_probability(value).replace("\u00a0", " ")
        for value in (0.0, 0.004, 0.02, 0.944, 0.996, 1.0)
    ]
    assert probabilities == ["< 1 %", "< 1 %", "2 %", "94 %", "> 99 %", "> 99 %"]
    lengths = [
        format_length(value).replace("\u00a0", " ")
        for value in (1.2345e-4, 0.9999e-3, 0.0213, None)
    ]
    assert lengths == ["123 µm", "1.00 mm", "21.3 mm", "unknown"]
    assert [
        format_millimetres(value) for value in (1.5e-5, 0.9999e-3, 1.184e-3, 0.0213)
    ] == [
        "0.015",
        "1.00",
        "1.18",
        "21.3",
    ]
    assert format_number(0.000123) == "0.000123" and format_number(1234.5) == "1234"
    assert [
        join_items("abc"),
        join_items("a"),
        join_items(""),
        join_items("abcde", 2),
    ] == [
        "a, b and c",
        "a",
        "none",
        "a, b and 3 more",
    ]
