"""Sets of points compared: made-up errors, by hand."""

import numpy as np
import pandas as pd
import pytest

from elastocal.study.budget_tables import budget_table, lengths_table, paired_table, root_mean

POINT_SETS = {"E": ["E"], "E twice": ["E", "E"], "three": ["A", "B", "E"]}
SETS, LENGTHS = 50, 12


def frame_of(scatter=0.2):
    """Mean squares that fall as one over the measurements, with a scatter that all sets of points of a data set share."""
    common = 1 + scatter * np.random.default_rng(1).standard_normal(SETS)
    parts = []
    for label, size in {"E": 1.0, "E twice": 2.2, "three": 2.5}.items():
        for length in range(1, LENGTHS + 1):
            square = 1e-8 * common / (size * length)
            parts.append(pd.DataFrame({"points": label, "data_set": range(SETS), "length": length, "mean_square": square}))
    frame = pd.concat(parts, ignore_index=True)
    return frame.assign(bound=0.9 * frame.mean_square)


def test_rows_have_as_many_configurations_and_as_many_measurements():
    table = budget_table({"arm": frame_of()}, POINT_SETS, 6)
    pairs = list(zip(table.points, table.configurations, table.measurements_per_configuration, strict=True))
    assert pairs == [("E", 6, 1), ("E", 12, 1), ("E twice", 6, 2), ("three", 4, 3), ("three", 6, 3)]
    mean = frame_of().query("points == 'E' and length == 6").mean_square.mean()
    assert table.rms_um[0] == pytest.approx(1e6 * np.sqrt(mean)) and table.crlb_rms_um[0] == pytest.approx(
        np.sqrt(0.9) * table.rms_um[0]
    )
    assert list(table)[-3:] == ["crlb_rms_um", "rms_um", "std_error_um"]


def test_pairs_are_compared_data_set_by_data_set():
    """The scatter that both share is in neither interval."""
    table = paired_table({"arm": frame_of()}, POINT_SETS, 6)
    assert table.points.tolist() == ["E twice", "three"]
    assert table.measurements.tolist() == [12, 12] and table.configurations_against.tolist() == [12, 12]
    assert table.ratio.tolist() == pytest.approx([np.sqrt(12 / 13.2), np.sqrt(12 / 10)])
    np.testing.assert_allclose(table.ratio_high / table.ratio_low, 1.0, atol=1e-9)
    alone = root_mean(frame_of().query("points == 'three' and length == 4").mean_square.to_numpy())[1]
    assert (table.difference_um_std_error < 0.2 * 1e6 * alone).all()


def test_data_sets_that_are_too_short_for_the_budget_have_no_row():
    short = frame_of().query("length < 12")
    assert paired_table({"arm": short}, POINT_SETS, 6).empty
    assert set(budget_table({"arm": short}, POINT_SETS, 6).configurations) == {4, 6}


def test_lengths_are_exact_with_an_interval():
    table = lengths_table({"arm": frame_of()}, POINT_SETS, [40.0, 1.0])
    row = table[(table.points == "E") & (table.accuracy_um == 40)].iloc[0]
    # 1e-8 / n <= (40e-6)^2 from n = 6.25 on.
    mean = frame_of().query("points == 'E' and length == 1").mean_square.mean()
    assert row.configurations == np.ceil(mean / 40e-6**2) == row.measurements
    assert row.configurations_low <= row.configurations <= row.configurations_high
    assert row.configurations_by_bound <= row.configurations
    assert np.isinf(table[table.accuracy_um == 1].configurations).all()


def test_a_length_counts_where_the_accuracy_is_kept_for_good():
    frame = frame_of(0.0)
    frame.loc[frame.length == 9, "mean_square"] = 1.0
    assert lengths_table({"arm": frame}, {"E": ["E"]}, [40.0]).configurations[0] == 10
