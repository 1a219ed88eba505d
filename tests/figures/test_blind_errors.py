"""Held-out errors of the blind cases stand against the oracle's, case by case and as shares."""

import pandas as pd
import pytest

from elastocal_proof.figures.blind_errors import errors_against_oracle


def test_errors_are_points_of_cases_that_have_an_oracle():
    table = pd.DataFrame(
        {
            "robots": "proof",
            "group": ["single", "single", "pair", "outside"],
            "level": [50.0, 50.0, 200.0, 200.0],
            "detected": [True, False, True, True],
            "after_rms_m": [1.1e-4, 1.3e-4, 1e-4, 9e-4],
            "oracle_rms_m": [1e-4, 1e-4, 1e-4, None],
        }
    )
    left, right = errors_against_oracle(table).axes
    detected, missed = (collection.get_offsets().tolist() for collection in left.collections)
    assert detected == [[pytest.approx(100.0), pytest.approx(110.0)], [pytest.approx(100.0)] * 2]
    assert missed == [[pytest.approx(100.0), pytest.approx(130.0)]]
    assert {"one effect, non-centrality 50", "two effects, 200 each"} <= set(right.get_legend_handles_labels()[1])


def of_cases(*rows, robots="proof"):
    """Cases of (group, level, RMS after, RMS of the oracle) in µm."""
    table = pd.DataFrame(rows, columns=["group", "level", "after_rms_m", "oracle_rms_m"])
    table[["after_rms_m", "oracle_rms_m"]] *= 1e-6
    return table.assign(robots=robots, detected=True)


def test_the_share_of_cases_rises_by_one_case_at_each_excess_over_the_oracle():
    table = of_cases(
        ("single", 50.0, 110, 100), ("single", 50.0, 99, 100), ("single", 50.0, 204, 200), ("single", 50.0, 300, 200)
    )
    _, right = errors_against_oracle(table).axes
    (curve,) = [line for line in right.lines if line.get_label().startswith("one effect")]
    assert curve.get_drawstyle() == "steps-pre"
    expected = [(-1, 0), (2, 25), (10, 50), (50, 75), (50, 100)]
    assert curve.get_xydata().tolist() == [pytest.approx(point) for point in expected]
    low, high = right.get_xlim()
    assert low < -1 and high > 50
    assert right.get_xlabel() == "RMS after the diagnosis above the oracle's (%)"


def test_a_case_without_a_held_out_error_leaves_the_others_drawn():
    table = of_cases(("single", 50.0, 110, 100), ("single", 50.0, float("nan"), 100))
    left, _ = errors_against_oracle(table).axes
    assert left.get_xlim()[0] < 100 < 110 < left.get_xlim()[1]
