import numpy as np
import pytest

from elastocal.errors import InputError
from elastocal.interface.arrays import check_array


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
