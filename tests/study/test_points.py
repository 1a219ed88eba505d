"""Comparisons of sets of points, on constructed errors with known results."""

import numpy as np
import pandas as pd
import pytest
from made_studies import USUAL

from elastocal.study.in_memory import StudyInMemory, StudySize
from elastocal.study.points import (
    build_break_even_table,
    build_lengths_table,
    build_paired_table,
    evaluate_point_sets,
    interpolate_configurations,
    score_rms,
)

POINT_SETS = {"E": ["E"], "E twice": ["E", "E"], "three": ["A", "B", "E"]}
SETS = 50
LENGTHS = 12


def frame_of(scatter=0.2):
    """Mean squares that fall as one over the measurements, with a scatter that all sets
    of points of a data set share."""
    common = 1 + scatter * np.random.default_rng(1).standard_normal(SETS)
    parts = []
    for label, size in {"E": 1.0, "E twice": 2.2, "three": 2.5}.items():
        for length in range(1, LENGTHS + 1):
            square = 1e-8 * common / (size * length)
            parts.append(
                pd.DataFrame(
                    {
                        "points": label,
                        "data_set": range(SETS),
                        "length": length,
                        "mean_square": square,
                    }
                )
            )
    return pd.concat(parts, ignore_index=True)


def test_pairs_are_compared_data_set_by_data_set():
    """The scatter that both sets share widens neither interval."""
    table = build_paired_table({"arm": frame_of()}, POINT_SETS, 6)
    assert table.points.tolist() == ["E twice", "three"]
    assert table.measurements.tolist() == [
        12,
        12,
    ] and table.configurations_against.tolist() == [12, 12]
    assert table.ratio.tolist() == pytest.approx([np.sqrt(12 / 13.2), np.sqrt(12 / 10)])
    np.testing.assert_allclose(table.ratio_high / table.ratio_low, 1.0, atol=1e-9)


def test_the_interval_of_a_ratio_is_that_of_the_bootstrap_over_data_sets():
    """With 2,000 replicates the ends of the interval are known to 3 %."""
    rng = np.random.default_rng(4)
    ours, theirs = rng.chisquare(5, (2, 200))
    drawn = rng.integers(0, 200, (2000, 200))
    expected = np.quantile(
        np.sqrt(ours[drawn].mean(axis=1) / theirs[drawn].mean(axis=1)), [0.025, 0.975]
    )
    assert score_rms(ours).compute_ratio(score_rms(theirs))[1:] == pytest.approx(
        expected, rel=0.02
    )


def test_lengths_are_exact_with_an_interval():
    table = build_lengths_table({"arm": frame_of()}, POINT_SETS, [40.0, 1.0])
    row = table[(table.points == "E") & (table.accuracy_um == 40)].iloc[0]
    # 1e-8 / n <= (40e-6)^2 from n = 6.25 on.
    mean = frame_of().query("points == 'E' and length == 1").mean_square.mean()
    assert row.configurations == np.ceil(mean / 40e-6**2) == row.measurements
    assert row.configurations_low <= row.configurations <= row.configurations_high
    assert np.isinf(table[table.accuracy_um == 1].configurations).all()


def test_a_length_counts_if_all_longer_ones_keep_the_accuracy():
    frame = frame_of(0.0)
    frame.loc[frame.length == 9, "mean_square"] = 1.0
    assert (
        build_lengths_table({"arm": frame}, {"E": ["E"]}, [40.0]).configurations[0]
        == 10
    )


POINT_SETS_OF_COSTS = {"one": ["A"], "two": ["A", "B"], "useless": ["A", "A"]}
LONG = np.arange(1, 101)


def frame(sizes=(300.0, 200.0, 300.0)):
    """Errors in µm of one configuration by set, the same in each of ten data sets."""
    sets = [
        (name, number, size)
        for name, size in zip(POINT_SETS_OF_COSTS, sizes, strict=True)
        for number in range(10)
    ]
    squares = [
        {
            "points": n,
            "data_set": k,
            "length": LONG,
            "mean_square": (1e-6 * size) ** 2 / LONG,
        }
        for n, k, size in sets
    ]
    return pd.concat(map(pd.DataFrame, squares), ignore_index=True)


@pytest.fixture
def weights():
    drawn = np.random.default_rng(1).poisson(1.0, (20, 10)) + 1.0
    return {"arm": np.vstack([np.ones(10), drawn])}


def test_the_length_is_where_the_curve_crosses_the_accuracy():
    squares = (300.0**2) / LONG
    assert interpolate_configurations(squares, 60.0) == pytest.approx(25.0)
    assert interpolate_configurations(squares, 59.0) == pytest.approx(
        (300 / 59) ** 2, rel=1e-3
    )
    assert (
        interpolate_configurations(squares, 1.0) == np.inf
        and interpolate_configurations(squares, 400.0) == 1.0
    )
    # If there is no estimate before a sufficient one, the first estimate counts.
    assert interpolate_configurations(
        np.array([np.nan, 50.0**2, 40.0**2]), 60.0
    ) == pytest.approx(2.0)


def test_a_set_pays_above_the_cost_at_which_both_sets_cost_the_same(weights):
    table = build_break_even_table(
        {"arm": frame()}, POINT_SETS_OF_COSTS, [60.0], weights
    ).set_index("points")
    # 25 configurations of one measurement, 100/9 of two: 25 (r + 1) = 100/9 (r + 2).
    expected = (200 / 9 - 25) / (25 - 100 / 9)
    assert table.break_even["two"] == pytest.approx(max(expected, 0.0), abs=0.01)
    assert table.break_even["useless"] == np.inf
    costly = build_break_even_table(
        {"arm": frame((300, 240, 300))}, POINT_SETS_OF_COSTS, [60.0], weights
    ).set_index("points")
    assert costly.break_even["two"] == pytest.approx((32 - 25) / (25 - 16), rel=1e-2)
    assert (
        costly.break_even_low["two"]
        <= costly.break_even["two"]
        <= costly.break_even_high["two"]
    )


POINT_SETS_OF_BUDGET = {"6DoF": ["6DoF"], "6DoF twice": ["6DoF", "6DoF"]}
SIZE = StudySize(data_sets=40, configurations=6, tests=30, noise=1e-5)


def test_a_point_measured_twice_has_noise_of_its_own(kuka):
    blocks = list(
        evaluate_point_sets(
            StudyInMemory(kuka, "kuka", 1, USUAL, SIZE), POINT_SETS_OF_BUDGET
        )
    )
    once, twice = (block["mean_square"].reshape(40, 6)[:, 5] for block in blocks[:2])
    # 40 data sets: the mean of the ratio of means, a half, has an error of about 15 %.
    assert ((twice / once).std() > 0.1) and 0.3 < twice.mean() / once.mean() < 0.8
