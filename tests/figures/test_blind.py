"""Pictures of the blind proof show the figures that their tables hold."""

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


def summary_row(quantity, rate, low, high, target):
    bounds = dict(zip(("target_low", "target_high"), target, strict=True))
    return {
        "robots": "proof",
        "quantity": quantity,
        "rate": rate,
        "low": low,
        "high": high,
        "target": "aim",
    } | bounds


MEAN = "held-out RMS after, over the oracle's, mean"


def test_targets_have_a_dot_with_its_interval_and_the_range_of_the_target():
    rows = [
        summary_row("detected at 50", 0.9, 0.85, 0.94, (0.97, 1.0)),
        summary_row(MEAN, 1.1, 1.0, 1.3, (0.0, 1.05)),
    ]
    rows.append(
        {
            "robots": "proof",
            "quantity": "detected at 10",
            "rate": 0.3,
            "low": 0.2,
            "high": 0.4,
            "target": None,
        }
    )
    rates, ratios = draw_targets(pd.DataFrame(rows)).axes
    assert row_labels(rates) == ["detected at 50"] and len(row_labels(ratios)) == 1
    assert [list(line.get_xdata()) for line in rates.lines] == [[85.0, 94.0], [90.0]]
    assert rates.patches[0].get_x() == pytest.approx(97.0) and rates.patches[
        0
    ].get_width() == pytest.approx(3.0)
    # Excesses over the oracle lie on an axis that is symmetric and holds every
    # interval.
    assert [list(line.get_xdata()) for line in ratios.lines] == [
        pytest.approx([0.0, 30.0]),
        pytest.approx([10.0]),
    ]
    low, high = ratios.get_xlim()
    assert low == -high and high > 30


def power_rows(effect, level, share, level_of="retained"):
    row = {"group": "single", "truth": effect, "level": level, "level_of": level_of}
    return row | dict.fromkeys(
        ["detected", "holds_truth", "named_right", "oracle_detected"], share
    )


def test_power_map_has_a_share_for_each_effect_and_level_and_marks_what_is_absorbed():
    rows = [
        power_rows("payload", level, share)
        for level, share in ((50.0, 0.5), (200.0, 0.9))
    ]
    rows += [
        power_rows("force_scale", level, 0.0, "raw") for level in (50.0, 200.0)
    ] + [power_rows("lost_motion", 200.0, 0.7)]
    rows += [power_rows("all", 50.0, 0.7)]
    figure = draw_power(pd.DataFrame(rows))
    assert row_labels(figure.axes[0]) == [
        "payload",
        "lost motion",
        "force scale *",
        "all effects",
    ]
    assert texts_in_axes(figure) == ["50", "90", "70", "70"] * 4
    shares = np.ma.filled(figure.axes[0].images[0].get_array().astype(float), np.nan)
    # A level at which an effect has no case stays empty.
    np.testing.assert_array_equal(
        np.isnan(shares), [[False, False], [True, False], [False, False], [False, True]]
    )
    assert (
        "no case"
        in texts_in_axes(draw_power(pd.DataFrame(rows).query("group == 'none'")))[0]
    )


def test_the_reliability_diagram_shows_observed_against_stated_shares_and_numbers_of_cases():
    rows = [
        ("all", 0.9, 1.0, 0.97, 0.95, 0.9, 0.99, 100),
        ("all", 0.3, 0.4, 0.35, 0.25, 0.0, 0.8, 4),
        ("single", 0.9, 1.0, 0.5, 0.0, 0.0, 0.4, 7),
    ]
    table = pd.DataFrame(
        rows, columns=["group", "from", "to", "stated", "rate", "low", "high", "cases"]
    )
    shares, counts = draw_reliability(table).axes
    drawn = [
        container.lines[0].get_xydata().tolist() for container in shares.containers
    ]
    assert drawn == [[[0.97, 0.95], [0.35, 0.25]]]
    ends = [path.vertices[:, 1].tolist() for path in shares.collections[0].get_paths()]
    assert ends == [pytest.approx([0.9, 0.99]), pytest.approx([0.0, 0.8])]
    assert [patch.get_height() for patch in counts.patches] == [100, 4]
    assert "No verdict" in texts_in_axes(draw_reliability(table.iloc[:0]))[0]


def test_every_error_is_drawn_where_its_model_stands():
    rows = [
        {
            "robot": robot,
            "part": task,
            "model": model,
            "rms_mm": 1.0 + number,
            "rms_mm_low": 0.9,
            "rms_mm_high": 6.0,
        }
        for robot in ("gp180", "kuka", "all")
        for task in PARTS
        for number, model in enumerate(MODELS)
    ]
    figure = draw_correction_errors(
        pd.DataFrame(rows), {"gp180": "Yaskawa GP180", "kuka": "KUKA KR 270"}
    )
    assert [axis.get_title() for axis in figure.axes] == [
        "unloaded",
        "under loads",
        "milling path",
    ]
    assert legend_entries(figure) == ["Yaskawa GP180", "KUKA KR 270"]
    labels = row_labels(figure.axes[0])
    assert labels[0] == "uncorrected" and labels[-1].startswith("true model")
    drawn = figure.axes[0].containers[0].lines[0]
    assert drawn.get_xdata().tolist() == [1.0, 2.0, 3.0, 4.0, 5.0]
    assert (pd.Series(drawn.get_ydata()).diff().dropna() < 0).all()
