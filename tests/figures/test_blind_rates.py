"""Rates of the blind proof are dots with their intervals, beside their targets."""

import pandas as pd
import pytest
from drawn_figures import assert_nothing_cut_off, legend_entries, row_labels, texts_in_axes

from elastocal_proof.blind.coverage import covered
from elastocal_proof.figures.blind_rates import coverage_by_effect, rates_and_targets


def summary_row(quantity, rate, low, high, target, robots="proof"):
    bounds = dict(zip(("target_low", "target_high"), target, strict=True))
    return {"robots": robots, "quantity": quantity, "rate": rate, "low": low, "high": high, "target": "aim"} | bounds


def test_targets_have_a_dot_with_its_interval_and_the_range_of_the_target():
    rows = [
        summary_row("detected at 50", 0.9, 0.85, 0.94, (0.97, 1.0)),
        summary_row("held-out RMS after, over the oracle's, mean", 1.02, 1.01, 1.03, (0.0, 1.05)),
    ]
    rows.append({"robots": "proof", "quantity": "detected at 10", "rate": 0.3, "low": 0.2, "high": 0.4, "target": None})
    figure = rates_and_targets(pd.DataFrame(rows))
    rates, ratios = figure.axes
    assert row_labels(rates) == ["detected at 50"] and len(row_labels(ratios)) == 1
    assert [list(line.get_xdata()) for line in rates.lines] == [[85.0, 94.0], [90.0]]
    assert rates.patches[0].get_x() == pytest.approx(97.0) and rates.patches[0].get_width() == pytest.approx(3.0)
    assert ratios.lines[1].get_xdata()[0] == pytest.approx(2.0)


def test_coverage_has_a_row_for_each_kind_and_numbers_of_intervals():
    head = {"robots": "proof", "setting": "usual", "truth": "joint_offset", "level": 50.0, "right": True}
    rows = [head | {"effect": "joint_offset", "parameter": "offset", "comparable": "exact", "holds": holds} for holds in (1, 0)]
    rows.append(head | {"effect": "joint_compliance", "parameter": "c1", "comparable": "exact", "holds": 1})
    figure = coverage_by_effect(covered(pd.DataFrame(rows)))
    assert row_labels(figure.axes[0]) == ["joint compliances, effect found", "parameters of all effects", "joint offset"]
    assert texts_in_axes(figure) == ["1", "2", "2", "intervals"]


def of_summary(*rows):
    return rates_and_targets(pd.DataFrame(rows))


def test_robots_of_the_proof_and_of_the_tuning_stand_side_by_side_in_one_row():
    rows = [
        summary_row("detected at 50", rate, 0.1, 0.9, (0.97, 1.0), robots) for robots, rate in (("tuned", 0.4), ("proof", 0.5))
    ]
    figure = of_summary(*rows, summary_row("held-out RMS after, over the oracle's, mean", 1.0, 0.9, 1.1, (0.0, 1.05)))
    dots = {line.get_marker(): line.get_xydata().tolist()[0] for line in figure.axes[0].lines if len(line.get_xdata()) == 1}
    assert dots == {"o": [50.0, -0.16], "D": [40.0, 0.16]}
    assert len(figure.axes[0].patches) == 1
    assert legend_entries(figure) == ["robots of the proof", "robots on which it was developed", "target"]
    assert_nothing_cut_off(figure)


def test_excesses_over_the_oracle_lie_on_an_axis_that_is_symmetric_and_holds_every_interval():
    ratios = of_summary(summary_row("held-out RMS after, over the oracle's, mean", 1.1, 1.0, 1.3, (0.0, 1.05))).axes[1]
    low, high = ratios.get_xlim()
    assert low == -high and high > 30
    assert ratios.get_xlabel() == "held-out RMS above the oracle's (%)"
    assert [list(line.get_xdata()) for line in ratios.lines] == [pytest.approx([0.0, 30.0]), pytest.approx([10.0])]


def coverage_row(kind, effect, rate, low, high, comparable="exact", **changes):
    row = {"robots": "proof", "kind": kind, "effect": effect, "parameter": "all", "level": "all", "comparable": comparable}
    return row | {"rate": rate, "low": low, "high": high, "cases": 40} | changes


def test_coverage_is_a_dot_with_its_interval_on_an_axis_that_holds_it():
    rows = [
        coverage_row("effect", "payload", 0.5, 0.3, 0.7, "by another law"),
        coverage_row("effect", "all", 0.95, 0.9, 0.98, "all"),
        coverage_row("effect", "payload", 0.1, 0.0, 0.2, parameter="mass"),
        coverage_row("effect", "payload", 0.1, 0.0, 0.2, level="50.0"),
        coverage_row("effect", "payload", 0.1, 0.0, 0.2, robots="tuned"),
    ]
    figure = coverage_by_effect(pd.DataFrame(rows))
    (axis,) = figure.axes
    assert row_labels(axis) == ["parameters of all effects", "payload"]
    spans = [
        line.get_xydata().tolist() for line in axis.lines if len(line.get_xdata()) == 2 and len(set(line.get_ydata())) == 1
    ]
    assert spans == [[[90, 0], [98, 0]], [[30, 1], [70, 1]]]
    dots = [(line.get_marker(), *line.get_xydata()[0]) for line in axis.lines if len(line.get_xdata()) == 1]
    assert dots == [("D", 95.0, 0.0), ("^", 50.0, 1.0)]
    assert axis.get_xlim()[0] < 30 and axis.get_ylim()[0] > axis.get_ylim()[1]
    band = axis.patches[0]
    assert (band.get_x(), band.get_x() + band.get_width()) == (92, 98)
    assert legend_entries(figure) == ["of another law than the catalogue's", "all together", "target, 92 to 98 %"]
    assert_nothing_cut_off(figure)
