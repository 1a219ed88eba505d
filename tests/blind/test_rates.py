"""Shares of cases and their exact intervals."""

import pytest
from scipy.stats import binomtest

from elastocal_proof.blind.rates import headed, rate


@pytest.mark.parametrize("hits, cases", [(1, 3), (7, 20), (19, 20), (150, 400)])
def test_the_interval_is_the_exact_one_of_the_binomial(hits, cases):
    found = rate([True] * hits + [False] * (cases - hits))
    exact = binomtest(hits, cases).proportion_ci(0.95, "exact")
    assert (found["hits"], found["cases"]) == (hits, cases)
    assert found["rate"] == pytest.approx(hits / cases)
    assert (found["low"], found["high"]) == pytest.approx((exact.low, exact.high), rel=1e-9)


@pytest.mark.parametrize("cases", [1, 10, 59])
def test_without_a_single_hit_or_miss_the_other_end_is_in_closed_form(cases):
    never, always = rate([False] * cases), rate([True] * cases)
    # (1 - p)^n = 2.5 %
    end = 1.0 - 0.025 ** (1.0 / cases)
    assert (never["rate"], never["low"], never["high"]) == (0.0, 0.0, pytest.approx(end))
    assert (always["rate"], always["low"], always["high"]) == (1.0, pytest.approx(1.0 - end), 1.0)


def test_a_head_names_the_share_and_both_ends_of_its_interval():
    found = rate([True, False, False])
    assert headed("named", found) == {"named": found["rate"], "named_low": found["low"], "named_high": found["high"]}
