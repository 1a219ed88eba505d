"""Numbers, units and names as people write them."""

import pytest

from elastocal.diagnosis.words import listed
from elastocal.report.wording import length, members_words, millimetres, plain, probability_words, scaled


@pytest.mark.parametrize(
    ("value", "error", "unit", "expected"),
    [
        (1.176e-4, 3.64e-6, "rad", ("117.6 ± 3.6", "µrad")),
        (20.61, 8.42, "N m", ("20.6 ± 8.4", "N·m")),
        (1.5365e-7, 2.678e-9, "1/(N m^2)", ("(1.537 ± 0.027) · 10⁻⁷", "1/(N·m²)")),
        (-1.588e-4, 8.2e-6, "rad kg/(N m)", ("−158.8 ± 8.2", "µrad·kg/(N·m)")),
        (2.0e-13, None, "rad/(N m)^3", ("2.000 · 10⁻⁷", "µrad/(N·m)³")),
        (0.0012, 0.0001, "m", ("1.20 ± 0.10", "mm")),
        (1000.0, None, "N", ("1000", "N")),
        (0.02, 0.001, "1", ("0.0200 ± 0.0010", "")),
        (0.0, 0.0, "rad", ("0", "µrad")),
        (2e-4, 1e-5, "rad/rad", ("(2.00 ± 0.10) · 10⁻⁴", "rad/rad")),
        (-4e-8, 1e-4, "m", ("0 ± 100", "µm")),
    ],
)
def test_values_come_in_units_that_suit_them(value, error, unit, expected):
    assert scaled(value, error, unit) == expected


def test_joints_count_up_and_those_of_which_the_same_is_told_stand_together():
    keys = [f"transmission_harmonic@{key}" for key in ("10[orders 1-2]", "2[orders 13-18]", "2[orders 3-6]", "4[orders 1-2]")]
    assert members_words(keys) == "joint 2: orders 3-6, orders 13-18; joints 4 and 10: orders 1-2"
    assert members_words(["cross_compliance@1+2", "cross_compliance@2+3"]) == "joints 1 and 2; joints 2 and 3"
    assert members_words([f"cross_compliance@{k}+{k + 1}" for k in range(1, 6)], 2) == "joints 1 and 2; joints 2 and 3; 3 more"
    assert members_words(["payload"]) == ""


def test_no_probability_is_zero_or_one():
    said = [probability_words(value).replace("\u00a0", " ") for value in (0.0, 0.004, 0.02, 0.944, 0.996, 1.0)]
    assert said == ["< 1 %", "< 1 %", "2 %", "94 %", "> 99 %", "> 99 %"]


def test_lengths():
    stated = [length(value).replace("\u00a0", " ") for value in (1.2345e-4, 0.9999e-3, 0.0213)]
    assert stated == ["123 µm", "1.00 mm", "21.3 mm"]
    assert length(None) == "unknown"
    assert [millimetres(value) for value in (1.5e-5, 0.9999e-3, 1.184e-3, 0.0213)] == ["0.015", "1.00", "1.18", "21.3"]
    assert plain(0.000123) == "0.000123" and plain(1234.5) == "1234"


def test_lists_are_sentences():
    assert [listed("abc"), listed("a"), listed("")] == ["a, b and c", "a", "none"]
    assert listed("abcde", 2) == "a, b and 3 more"
