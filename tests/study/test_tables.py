"""Tables, against hand calculations."""

import numpy as np
import pytest
from made_studies import metrics_of, replicates_of

from elastocal.study.tables import build_table4, format_value, merge_errors


def test_a_length_that_is_not_reached_is_infinite_and_keeps_the_error_of_the_law_it_follows():
    table = build_table4(
        metrics_of("A", 200.0),
        replicates_of("A", 200.0),
        ["arm"],
        ["A"],
        200.0,
        20,
        1.0,
        1.0,
    ).iloc[0]
    assert np.isinf(
        table.n_k_sigma_1_percent
    ) and table.n_k_sigma_1_percent_std_error == pytest.approx(20.0)
    assert (
        merge_errors(table.to_frame().T.infer_objects()).n_k_sigma_1_percent.iloc[0]
        == "not reached"
    )


def test_lengths_of_table4_are_those_of_its_own_limits_each_between_two_lengths():
    """Biases of 40 % and 20 % over the length fall below 3 % and 40 um below 7 um at
    the next whole length."""
    table = build_table4(
        metrics_of("A", 40.0),
        replicates_of("A", 40.0),
        ["arm"],
        ["A"],
        200.0,
        20,
        3.0,
        7.0,
    ).iloc[0]
    assert (
        table.n_k_sigma_3_percent,
        table.n_k_sigma_3_percent_fixed_joints,
        table.n_dev_7_um,
    ) == (14, 7, 6)
    # Replicates of 36, 40 and 44 %.
    assert table.n_k_sigma_3_percent_std_error == pytest.approx(
        np.std([12, 14, 15], ddof=1)
    )
    assert table.n_dev_7_um_std_error == pytest.approx(np.std([6, 6, 7], ddof=1))


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
def test_values_are_worded_with_two_digits_of_their_error(value, error, text):
    assert format_value(value, error) == text
