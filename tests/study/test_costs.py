"""Costs of an accuracy where errors fall as one over the root of the number of configurations."""

import numpy as np
import pandas as pd
import pytest

from elastocal.study.costs import break_even_table, configurations_needed, cost_table

POINT_SETS = {"one": ["A"], "two": ["A", "B"], "useless": ["A", "A"]}
LENGTHS = np.arange(1, 101)


def frame(sizes=(300.0, 200.0, 300.0)):
    """Errors in µm of one configuration by set, the same in each of ten data sets."""
    parts = [
        pd.DataFrame({"points": name, "data_set": number, "length": LENGTHS, "mean_square": (1e-6 * size) ** 2 / LENGTHS})
        for name, size in zip(POINT_SETS, sizes, strict=True)
        for number in range(10)
    ]
    return pd.concat(parts, ignore_index=True)


@pytest.fixture
def weights():
    drawn = np.random.default_rng(1).poisson(1.0, (20, 10)) + 1.0
    return {"arm": np.vstack([np.ones(10), drawn])}


def test_the_length_is_where_the_curve_crosses_the_accuracy():
    squares = (300.0**2) / LENGTHS
    assert configurations_needed(squares, 60.0) == pytest.approx(25.0)
    assert configurations_needed(squares, 59.0) == pytest.approx((300 / 59) ** 2, rel=1e-3)
    assert configurations_needed(squares, 1.0) == np.inf and configurations_needed(squares, 400.0) == 1.0


def test_a_set_pays_from_the_cost_on_at_which_both_cost_the_same(weights):
    table = break_even_table({"arm": frame()}, POINT_SETS, [60.0], weights).set_index("points")
    # 25 configurations of one measurement, 100/9 of two: 25 (r + 1) = 100/9 (r + 2).
    expected = (200 / 9 - 25) / (25 - 100 / 9)
    assert table.break_even["two"] == pytest.approx(max(expected, 0.0), abs=0.01)
    assert table.break_even["useless"] == np.inf
    costly = break_even_table({"arm": frame((300, 240, 300))}, POINT_SETS, [60.0], weights).set_index("points")
    assert costly.break_even["two"] == pytest.approx((32 - 25) / (25 - 16), rel=1e-2)
    assert costly.break_even_low["two"] <= costly.break_even["two"] <= costly.break_even_high["two"]


def test_the_cheapest_set_changes_at_its_break_even(weights):
    table = cost_table({"arm": frame((300, 240, 300))}, POINT_SETS, 60.0, weights)
    cheapest = table[table.cheapest].set_index("configuration_cost").points
    assert (
        cheapest[0.0] == "one" and cheapest.iloc[-1] == "two" and table.groupby("configuration_cost").cheapest.sum().eq(1).all()
    )
    assert table[table.points == "one"].ratio.eq(1.0).all()
