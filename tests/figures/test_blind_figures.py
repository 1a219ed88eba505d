"""Figures of the blind proof show what their tables say, with and without cases."""

import pandas as pd
import pytest

from elastocal.blind.coverage import covered
from elastocal.blind.power import powers
from elastocal.figures.blind_errors import errors_against_oracle
from elastocal.figures.blind_power import confusion_map, power_map
from elastocal.figures.blind_rates import coverage_by_effect, rates_and_targets
from elastocal.figures.blind_reliability import reliability_diagram
from elastocal.figures.style import save

POWER = ["detected", "held", "named", "oracle_detected"]


def power_rows(effect, level, share, level_of="retained", robots="proof"):
    row = {"robots": robots, "group": "single", "effect": effect, "level": level, "level_of": level_of}
    return row | dict.fromkeys(POWER, share)


def texts(figure):
    return [text.get_text() for axis in figure.axes for text in axis.texts]


def labels(axis):
    return [label.get_text() for label in axis.get_yticklabels()]


def test_power_map_has_a_share_for_each_effect_and_level_and_marks_what_is_absorbed():
    rows = [power_rows("payload", level, share) for level, share in ((50.0, 0.5), (200.0, 0.9))]
    rows += [power_rows("force_scale", level, 0.0, "raw") for level in (50.0, 200.0)]
    rows += [power_rows("all", 50.0, 0.7), power_rows("payload", 50.0, 0.11, robots="tuned")]
    figure = power_map(pd.DataFrame(rows))
    assert labels(figure.axes[0]) == ["payload", "force scale *", "all effects"]
    assert texts(figure) == ["50", "90", "70"] * 4


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
    assert labels(figure.axes[0]) == ["payload", "outside: refraction", "no effect"]
    shares = [text.get_text() for text in figure.axes[0].texts if text.get_text() != "cases"]
    assert shares == ["75", "25", "100", "100", "4", "2", "10"]
    said = [label.get_text() for label in figure.axes[0].get_xticklabels()]
    assert said[0] == "payload" and "joint offset" not in said and said[-1] == "adequate"


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
    assert labels(rates) == ["detected at 50"] and len(labels(ratios)) == 1
    assert [list(line.get_xdata()) for line in rates.lines] == [[85.0, 94.0], [90.0]]
    assert rates.patches[0].get_x() == pytest.approx(97.0) and rates.patches[0].get_width() == pytest.approx(3.0)
    assert ratios.lines[1].get_xdata()[0] == pytest.approx(2.0)


def test_coverage_has_a_row_for_each_kind_and_numbers_of_intervals():
    head = {"robots": "proof", "setting": "usual", "truth": "joint_offset", "level": 50.0, "right": True}
    rows = [head | {"effect": "joint_offset", "parameter": "offset", "comparable": "exact", "holds": holds} for holds in (1, 0)]
    rows.append(head | {"effect": "joint_compliance", "parameter": "c1", "comparable": "exact", "holds": 1})
    figure = coverage_by_effect(covered(pd.DataFrame(rows)))
    assert labels(figure.axes[0]) == ["joint compliances, effect found", "parameters of all effects", "joint offset"]
    assert texts(figure) == ["1", "2", "2", "intervals"]


def test_the_reliability_diagram_shows_shares_against_what_was_stated_and_numbers_of_cases():
    rows = [
        ("proof", "all", 0.9, 1.0, 0.97, 95, 100),
        ("proof", "all", 0.3, 0.4, 0.35, 1, 4),
        ("tuned", "all", 0.9, 1.0, 0.95, 9, 9),
    ]
    rows.append(("proof", "single", 0.9, 1.0, 0.5, 0, 7))
    table = pd.DataFrame(rows, columns=["robots", "group", "from", "to", "stated", "hits", "cases"])
    table = table.assign(rate=table.hits / table.cases, low=0.0, high=1.0)
    shares, counts = reliability_diagram(table).axes
    drawn = [container.lines[0].get_xydata().tolist() for container in shares.containers]
    assert drawn == [[[0.97, 0.95], [0.35, 0.25]], [[0.95, 1.0]]]
    assert [patch.get_height() for patch in counts.patches] == [100, 4, 9]
    assert "No verdict" in texts(reliability_diagram(table.iloc[:0]))[0]


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


def test_figures_can_be_drawn_of_a_run_without_such_cases(tmp_path):
    columns = ["robots", "group", "truth", "level", "level_of", "detected", "after_rms_m", "oracle_rms_m", "oracle_detected"]
    nothing = pd.DataFrame(columns=columns)
    confusion = pd.DataFrame([confusion_row("payload", 50.0, settings="hard", adequate=4)])
    for figure in (
        power_map(powers(nothing)),
        confusion_map(confusion),
        coverage_by_effect(covered(pd.DataFrame())),
        errors_against_oracle(nothing),
    ):
        save(figure, f"{tmp_path}/figure.pdf", f"{tmp_path}/figure.png")
