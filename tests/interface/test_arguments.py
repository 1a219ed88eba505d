import numpy as np
import pytest

from elastocal.errors import InputError
from elastocal.interface.arguments import (
    check_array,
    check_count,
    check_instance,
    check_size,
)


def test_numbers_of_the_shape_are_returned_as_floats():
    array = check_array("call", "angles", [[1, 2], [3, 4]], (None, 2))
    assert array.dtype == float
    np.testing.assert_array_equal(array, [[1.0, 2.0], [3.0, 4.0]])


@pytest.mark.parametrize(
    ("values", "finding"),
    [
        ([[1, 2, 3]], "an array of shape (1, 3)"),
        ([1, 2], "an array of shape (2,)"),
        ("heavy", "no numbers"),
        ([[1, 2], [3]], "no numbers"),
    ],
)
def test_other_arrays_are_refused_with_the_name_of_the_argument(values, finding):
    with pytest.raises(InputError) as caught:
        check_array("call", "angles", values, (None, 2))
    assert str(caught.value).startswith(f"call: angles: found {finding}")


def test_values_of_any_kind_keep_their_kind():
    assert check_array("call", "names", ["a", "b"], (2,), None).tolist() == ["a", "b"]


def test_an_argument_of_another_class_is_refused_with_what_is_allowed():
    check_instance("call", "name", "a", (str, int), "a name")
    with pytest.raises(InputError, match="call: name: found None; allowed: a name"):
        check_instance("call", "name", None, str, "a name")


@pytest.mark.parametrize("value", [2.5, -1, "3", None, np.nan])
def test_a_count_is_an_integer_of_at_least_the_lowest(value):
    check_count("call", "poses", np.int64(0), 0)
    with pytest.raises(InputError, match=r"call: poses: .* an integer, 0 or more"):
        check_count("call", "poses", value, 0)


@pytest.mark.parametrize("value", [-1e-6, np.inf, np.nan, "0.2mm", None])
def test_a_size_is_a_finite_number_and_not_negative(value):
    check_size("call", "noise_m", np.float32(0.0))
    with pytest.raises(InputError, match=r"call: noise_m: .* a finite number, 0"):
        check_size("call", "noise_m", value)
