"""Heat maps of the blind proof show the shares that their tables hold."""

import numpy as np
import pandas as pd
from drawn_figures import assert_nothing_cut_off, row_labels, texts_in_axes

from elastocal_proof.figures.blind_power import confusion_map, power_map

POWER = ["detected", "held", "named", "oracle_detected"]


def power_rows(effect, level, share, level_of="retained", robots="proof"):
    row = {"robots": robots, "group": "single", "effect": effect, "level": level, "level_of": level_of}
    return row | dict.fromkeys(POWER, share)


def test_power_map_has_a_share_for_each_effect_and_level_and_marks_what_is_absorbed():
    rows = [power_rows("payload", level, share) for level, share in ((50.0, 0.5), (200.0, 0.9))]
    rows += [power_rows("force_scale", level, 0.0, "raw") for level in (50.0, 200.0)]
    rows += [power_rows("all", 50.0, 0.7), power_rows("payload", 50.0, 0.11, robots="tuned")]
    figure = power_map(pd.DataFrame(rows))
    assert row_labels(figure.axes[0]) == ["payload", "force scale *", "all effects"]
    assert texts_in_axes(figure) == ["50", "90", "70"] * 4


def confusion_row(truth, level, robots="proof", settings="usual", **said):
    columns = ["payload", "joint_offset", "class with the truth", "class without the truth", "several", "unexplained"]
    columns += ["not_testable", "adequate"]
    return {"robots": robots, "settings": settings, "truth": truth, "level": level} | dict.fromkeys(columns, 0) | said


def test_confusion_map_shows_shares_at_the_largest_size_of_the_usual_setting():
    table = pd.DataFrame(
        [
            confusion_row("payload", 50.0, adequate=4),
            confusion_row("payload", 200.0, payload=3, several=1),
            confusion_row("payload", 200.0, settings="hard", adequate=9),
            confusion_row("outside:refraction", 200.0, unexplained=2),
            confusion_row("none", 0.0, adequate=10),
        ]
    )
    figure = confusion_map(table)
    assert row_labels(figure.axes[0]) == ["payload", "outside: refraction", "no effect"]
    shares = [text.get_text() for text in figure.axes[0].texts if text.get_text() != "cases"]
    assert shares == ["75", "25", "100", "100", "4", "2", "10"]
    said = [label.get_text() for label in figure.axes[0].get_xticklabels()]
    assert said[0] == "payload" and "joint offset" not in said and said[-1] == "adequate"


def heat(axis):
    return np.ma.filled(axis.images[0].get_array().astype(float), np.nan)


def test_a_level_at_which_an_effect_has_no_case_stays_empty():
    rows = [power_rows("payload", 50.0, 0.5), power_rows("payload", 200.0, 0.9), power_rows("lost_motion", 200.0, 0.7)]
    axis = power_map(pd.DataFrame(rows)).axes[0]
    assert row_labels(axis) == ["payload", "lost motion"]
    np.testing.assert_array_equal(np.isnan(heat(axis)), [[False, False], [True, False]])
    assert [text.get_text() for text in axis.texts] == ["50", "90", "70"]


def test_right_names_are_framed_and_shares_of_a_row_add_up_to_one():
    rows = [confusion_row("payload", 200.0, payload=3, joint_offset=1), confusion_row("joint_offset", 200.0, payload=2)]
    figure = confusion_map(pd.DataFrame([*rows, confusion_row("none", 0.0, adequate=5)]))
    (axis,) = figure.axes
    shares = heat(axis)
    np.testing.assert_allclose(shares[:2, :2], [[0.75, 0.25], [1.0, 0.0]])
    np.testing.assert_allclose(shares.sum(axis=1), 1.0)
    frames = [(patch.get_x() + 0.5, patch.get_y() + 0.5) for patch in axis.patches]
    assert frames == [(0.0, 0.0), (1.0, 1.0)]
    assert_nothing_cut_off(figure)
