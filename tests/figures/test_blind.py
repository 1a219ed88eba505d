"""Figures of the blind benchmark and the closed loop show the numbers of their tables."""

import numpy as np
import pandas as pd
import pytest
from drawn_figures import legend_entries, row_labels, texts_in_axes

from elastocal_proof.blind.closed_loop import MODELS, PARTS
from elastocal_proof.figures.blind import (
    draw_correction_errors,
    draw_power,
    draw_reliability,
    draw_targets,
)


def make_summary_row(quantity, rate, interval, target_range):
    low, high = interval
    target_low, target_high = target_range
    return {
        "robots": "proof",
        "quantity": quantity,
        "rate": rate,
        "low": low,
        "high": high,
        "target": "aim",
        "target_low": target_low,
        "target_high": target_high,
    }


def test_targets_have_a_dot_with_its_interval_and_the_range_of_the_target():
    without_target = {
        "quantity": "detected at 10",
        "rate": 0.3,
        "low": 0.2,
        "high": 0.4,
    }
    rows = [
        make_summary_row("detected at 50", 0.9, (0.85, 0.94), (0.97, 1.0)),
        make_summary_row(
            "held-out RMS after, over the oracle's, mean", 1.1, (1.0, 1.3), (0.0, 1.05)
        ),
        without_target | {"robots": "proof", "target": None},
    ]
    rates, ratios = draw_targets(pd.DataFrame(rows)).axes
    assert row_labels(rates) == ["detected at 50"]
    assert len(row_labels(ratios)) == 1
    assert [list(curve.get_xdata()) for curve in rates.lines] == [[85.0, 94.0], [90.0]]
    target_bar = rates.patches[0]
    assert target_bar.get_x() == pytest.approx(97.0)
    assert target_bar.get_width() == pytest.approx(3.0)
    # Excesses over the oracle have a symmetric axis that contains every interval.
    assert [list(curve.get_xdata()) for curve in ratios.lines] == [
        pytest.approx([0.0, 30.0]),
        pytest.approx([10.0]),
    ]
    low, high = ratios.get_xlim()
    assert low == -high
    assert high > 30


def make_power_row(effect, level, share, level_of="retained"):
    shares = ["detected", "holds_truth", "named_right", "located", "oracle_detected"]
    row = {"group": "single", "truth": effect, "level": level, "level_of": level_of}
    return row | dict.fromkeys(shares, share)


def test_power_has_a_share_for_each_effect_and_level_and_marks_absorbed_effects():
    rates = pd.DataFrame(
        [
            make_power_row("payload", 50.0, 0.5),
            make_power_row("payload", 200.0, 0.9),
            make_power_row("force_scale", 50.0, 0.0, "raw"),
            make_power_row("force_scale", 200.0, 0.0, "raw"),
            make_power_row("lost_motion", 200.0, 0.7),
            make_power_row("all", 50.0, 0.7),
        ]
    )
    figure = draw_power(rates)
    assert row_labels(figure.axes[0]) == [
        "weight of an undeclared payload",
        "lost motion (backlash)",
        "scale error of the force sensor *",
        "all effects",
    ]
    assert texts_in_axes(figure) == ["50", "90", "70", "0", "0", "70"] * 5
    cells = figure.axes[0].images[0].get_array().astype(float)
    # A level at which an effect has no case is hatched, and has no number.
    assert len(figure.axes[0].patches) == 2
    np.testing.assert_array_equal(
        np.isnan(np.ma.filled(cells, np.nan)),
        [[False, False], [True, False], [False, False], [False, True]],
    )
    without_single_effects = draw_power(rates.query("group == 'none'"))
    assert "no case" in texts_in_axes(without_single_effects)[0]


def test_reliability_shows_shares_of_bins_with_cases_enough_and_all_numbers_of_cases():
    rows = [
        ("all", 0.9, 1.0, 0.97, 0.95, 0.9, 0.99, 107),
        ("alarm", 0.9, 1.0, 0.97, 0.95, 0.9, 0.99, 100),
        ("alarm", 0.3, 0.4, 0.35, 0.25, 0.0, 0.8, 4),
        ("no alarm", 0.9, 1.0, 0.95, 0.5, 0.2, 0.8, 17),
    ]
    table = pd.DataFrame(
        rows, columns=["group", "from", "to", "stated", "rate", "low", "high", "cases"]
    )
    shares, counts = draw_reliability(table).axes
    points = [
        container.lines[0].get_xydata().tolist() for container in shares.containers
    ]
    assert points == [[[0.97, 0.95]], [[0.95, 0.5]]]
    intervals = [
        path.vertices[:, 1].tolist() for path in shares.collections[0].get_paths()
    ]
    assert intervals == [pytest.approx([0.9, 0.99])]
    assert [patch.get_height() for patch in counts.patches] == [100, 4, 17]
    assert "No verdict" in texts_in_axes(draw_reliability(table.iloc[:0]))[0]


def test_every_error_is_drawn_in_the_row_of_its_model():
    rows = [
        {
            "robot": robot,
            "part": part,
            "model": model,
            "reached_mm": 1.0 + number,
            "reached_mm_low": 0.9,
            "reached_mm_high": 6.0,
        }
        for robot in ("gp180", "kuka", "all")
        for part in PARTS
        for number, model in enumerate(MODELS)
    ]
    names = {"gp180": "Yaskawa GP180", "kuka": "KUKA KR 270"}
    figure = draw_correction_errors(pd.DataFrame(rows), names)
    assert [axis.get_title() for axis in figure.axes] == [
        "unloaded",
        "under load",
        "milling path",
    ]
    assert legend_entries(figure) == ["Yaskawa GP180", "KUKA KR 270"]
    labels = row_labels(figure.axes[0])
    assert labels[0] == "uncorrected"
    assert labels[-1].startswith("true model")
    marks = figure.axes[0].containers[0].lines[0]
    assert marks.get_xdata().tolist() == [1.0, 2.0, 3.0, 4.0, 5.0]
    assert (np.diff(marks.get_ydata()) < 0).all()
