"""Figures of the league: errors with intervals, ratios on the same poses, coverage, cost, mechanisms."""

import numpy as np
import pytest
from made_leagues import made_entries, made_results

from elastocal_proof.league.methods import Method
from elastocal_proof.league.table import cost_table, league_table

ROBOTS = {"A robot": ["one"], "Another": ["two"]}


@pytest.fixture(scope="module")
def table():
    return league_table(made_results(), ROBOTS, "geometry", 1)


def row(table, data="one", split="random", method="half"):
    return table[(table["data"] == data) & (table["split"] == split) & (table["method"] == method)].iloc[0]


def test_errors_are_those_of_the_entries(table):
    entries = made_entries(1e-4, 30, 1)
    off = np.linalg.norm(entries[["dx", "dy", "dz"]], axis=1)
    found = row(table)
    assert found["rms_mm"] == pytest.approx(1e3 * np.sqrt((off**2).mean())) and found["max_mm"] == pytest.approx(
        1e3 * off.max()
    )
    assert found["rms_low_mm"] < found["rms_mm"] < found["rms_high_mm"]
    assert found["poses"] == 30 and found["robot"] == "A robot" and found["outside"] == pytest.approx(0.1)
    assert found["share_below_max"] == pytest.approx(0.05 ** (1 / 30))


def test_ratios_count_from_the_reference_and_from_the_best_on_the_same_poses(table):
    """Errors of the same draws, half as large: the ratio is exact and so is its interval."""
    found, reference, process = row(table), row(table, method="geometry"), row(table, method="process")
    assert found["ratio"] == pytest.approx(0.5) and found["ratio_low"] == pytest.approx(0.5) == found["ratio_high"]
    assert reference["ratio"] == 1.0 and found["ratio_to_best"] == 1.0
    assert process["ratio_to_best"] == pytest.approx(1.2) == process["ratio_to_best_low"]


def test_a_method_that_builds_on_a_diagnosis_bears_its_cost():
    timings = {("one", "random", name): {"cpu_time": 10.0, "max_rss": 300.0} for name in ("geometry", "found")}
    timings["one", "random"] = {"cpu_time": 40.0, "max_rss": 700.0}
    methods = {"geometry": Method("geometry"), "found": Method("diagnosis")}
    found = cost_table(timings, {("one", "random"): 5}, methods).set_index("method")
    assert found.loc["geometry", ["seconds_per_fold", "memory_MB"]].tolist() == [2.0, 300.0]
    assert found.loc["found", ["seconds_per_fold", "memory_MB"]].tolist() == [10.0, 700.0]
