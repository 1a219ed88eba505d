"""Tables, against hand calculations."""

import numpy as np
import pytest
from made_studies import metrics_of, replicates_of

from elastocal.study.tables import Results, build_table4, format_value, merge_errors


def table4_row(bias, k_sigma_limit, deviation_limit):
    """The row of one strategy whose scores fall as bias over the length."""
    results = Results(metrics_of("A", bias), replicates_of("A", bias), 200.0, 20)
    table = build_table4(results, ["arm"], ["A"], k_sigma_limit, deviation_limit)
    return table.iloc[0]


def test_a_length_that_is_not_reached_is_infinite_and_keeps_the_extrapolated_error():
    row = table4_row(200.0, 1.0, 1.0)
    assert np.isinf(row.n_k_sigma_1_percent)
    assert row.n_k_sigma_1_percent_std_error == pytest.approx(20.0)
    worded = merge_errors(row.to_frame().T.infer_objects())
    assert worded.n_k_sigma_1_percent.iloc[0] == "not reached"


def test_lengths_of_table4_are_the_first_whole_lengths_below_each_limit():
    """Biases of 40 % and 20 % over the length fall below 3 %, and 40 um below 7 um, at
    the next whole length."""
    row = table4_row(40.0, 3.0, 7.0)
    assert row.n_k_sigma_3_percent == 14
    assert row.n_k_sigma_3_percent_fixed_joints == 7
    assert row.n_dev_7_um == 6
    # The replicates have biases of 36, 40 and 44 %.
    k_sigma_error = np.std([12, 14, 15], ddof=1)
    assert row.n_k_sigma_3_percent_std_error == pytest.approx(k_sigma_error)
    assert row.n_dev_7_um_std_error == pytest.approx(np.std([6, 6, 7], ddof=1))


@pytest.mark.parametrize(
    "value, error, text",
    [
        (4.5371, 0.539, "4.54 ± 0.54"),
        (314.12, 13.9, "314 ± 14"),
        (0.36660, 0.00093, "0.36660 ± 0.00093"),
        (2.79, np.nan, "2.79"),
        (np.inf, np.nan, "not reached"),
        (np.nan, np.nan, ""),
        ("kuka", np.nan, "kuka"),
    ],
)
def test_values_are_formatted_with_two_digits_of_their_error(value, error, text):
    assert format_value(value, error) == text
