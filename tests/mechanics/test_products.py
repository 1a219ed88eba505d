"""Products and sums in which a plain 0 or 1 costs nothing: their values, and that no operand changes."""

from itertools import product as pairs

import numpy as np
import pytest

from elastocal.mechanics.products import product, product_difference, product_sum

ARRAY, OTHER = np.array([2.0, -3.0, 0.5]), np.array([-1.0, 4.0, 0.25])
KINDS = {"zero": 0.0, "one": 1.0, "number": -2.5, "array": ARRAY, "other": OTHER}
TWO = list(pairs(KINDS, repeat=2))
FOUR = list(pairs(KINDS, repeat=4))


def kept(function, *values):
    before = [np.copy(value) for value in values]
    found = function(*values)
    for value, old in zip(values, before, strict=True):
        np.testing.assert_array_equal(value, old)
    return found


def test_a_product_is_that_of_numpy_and_changes_no_factor():
    for a, b in TWO:
        np.testing.assert_array_equal(kept(product, KINDS[a], KINDS[b]), np.multiply(KINDS[a], KINDS[b]) + 0.0)


def test_sums_and_differences_of_products_are_those_of_numpy_and_change_no_factor():
    for names in FOUR:
        a, b, c, d = (KINDS[name] for name in names)
        np.testing.assert_allclose(kept(product_sum, a, b, c, d), a * b + c * d, atol=1e-15, err_msg=str(names))
        np.testing.assert_allclose(kept(product_difference, a, b, c, d), a * b - c * d, atol=1e-15, err_msg=str(names))


@pytest.mark.parametrize("a, b", [(1.0, ARRAY), (ARRAY, 1.0)])
def test_a_factor_of_one_makes_no_copy(a, b):
    assert product(a, b) is ARRAY and product_sum(a, b, 0.0, OTHER) is ARRAY


@pytest.mark.parametrize("a, b", [(0.0, ARRAY), (ARRAY, 0.0), (0.0, 0.0)])
def test_a_factor_of_zero_makes_a_plain_zero(a, b):
    assert type(product(a, b)) is float and product(a, b) == 0.0


def test_constants_stay_plain_numbers():
    for function, value in ((product_sum, 26.0), (product_difference, -14.0)):
        found = function(2.0, 3.0, 4.0, 5.0)
        assert type(found) is float and found == value


def test_a_sum_takes_the_memory_of_its_own_product_and_of_no_operand():
    found = [function(ARRAY, OTHER, ARRAY, ARRAY) for function in (product_sum, product_difference)]
    assert not any(np.shares_memory(one, other) for one in found for other in (ARRAY, OTHER))
