"""Figures of a campaign show the values of their tables, and nothing is cut off."""

import numpy as np
import pandas as pd
import pytest
from drawn_figures import assert_nothing_cut_off, legend_entries, row_labels, texts
from made_certificates import make_document
from made_loop_tables import candidate_table, plainly, residual_table, step_rows
from made_loop_tables import probabilities as stated
from matplotlib.quiver import Quiver, QuiverKey

from elastocal.figures.loop import (
    METRICS,
    draw_before_after,
    draw_budget_bars,
    draw_errors_by_campaign,
    draw_probabilities,
    draw_residual_arrows,
)

LONG = (
    "link_elasticity@1+2+3+6[one section]",
    "force_misalignment[flange axes]",
    "transmission_harmonic@1[orders 31-36]",
)
LONG_SETS = [
    ({"link_elasticity": ["links 1 and 2 and 3 and 6 one section"]}, 0.7),
    (
        {
            "joint_dependent_stiffness": ["joint 5"],
            "transmission_harmonic": ["joint 1 orders 1-2", "joint 1 orders 3-6"],
        },
        0.2,
    ),
    ({"other": ["base"]}, 0.1),
]


def of_the_catalogue():
    """A candidates table with the longest names that there are."""
    table = candidate_table()
    table["candidate"][: len(LONG)] = LONG
    return table


FIGURES = {
    "arrows": lambda: draw_residual_arrows(residual_table()),
    "candidates": lambda: draw_probabilities(stated(LONG_SETS), of_the_catalogue()),
    "before_after": lambda: draw_before_after(
        step_rows(
            effects=("transmission_harmonic@1[orders 31-36], transmission_ratio@2",)
        ),
        5e-6,
    ),
}


@pytest.mark.parametrize("name", FIGURES)
def test_nothing_is_cut_off(name):
    assert_nothing_cut_off(FIGURES[name]())


def quivers(axis):
    return [artist for artist in axis.get_children() if isinstance(artist, Quiver)]


def state_means(table):
    """Positions and residuals (states, 3) in m, averaged over the repeats of each
    held-out flag, pose, load and target."""
    names = ("held_out", "pose", "load", "target")
    keys = np.column_stack([table[name] for name in names])
    members = [(keys == key).all(axis=1) for key in np.unique(keys, axis=0)]

    def average(columns):
        values = np.column_stack([table[column] for column in columns])
        return np.array([values[rows].mean(axis=0) for rows in members])

    return average("xyz"), average([f"before_d{axis}" for axis in "xyz"])


def test_arrows_begin_at_their_state_and_are_its_mean_residual_enlarged_as_the_arrow_of_the_scale():
    table = residual_table(poses=20, repeats=3)
    figure = draw_residual_arrows(table)
    (key,) = figure.findobj(QuiverKey)
    assert key.label == "200 µm"
    positions, residuals = state_means(table)
    for view, axes in ((0, [0, 2]), (1, [0, 1])):
        (quiver,) = [
            quiver
            for quiver in quivers(figure.axes[view])
            if quiver.get_gid() == "before"
        ]
        assert (
            figure.axes[view].get_xlabel() == "x (m)"
            and figure.axes[view].get_ylabel() == f"{'xyz'[axes[1]]} (m)"
        )
        np.testing.assert_allclose(quiver.XY, positions[:, axes])
        drawn = np.column_stack([quiver.U, quiver.V])
        np.testing.assert_allclose(
            drawn, residuals[:, axes] * key.U / 200e-6, rtol=1e-9, atol=1e-12
        )


def test_residuals_that_no_effect_changed_are_drawn_once():
    table = residual_table()
    same = table | {f"after_d{axis}": table[f"before_d{axis}"] for axis in "xyz"}
    drawn = []
    for residuals in (table, same):
        axis = draw_residual_arrows(residuals).axes[0]
        drawn.append({quiver.get_gid() for quiver in quivers(axis)})
    assert drawn == [{"before", "after"}, {"before"}]


def lines_of(axis, gid):
    return [line.get_xydata().tolist() for line in axis.lines if line.get_gid() == gid]


def test_bars_for_every_model_and_measure_from_top_to_bottom_with_diamonds_for_fitted_poses():
    steps = step_rows()
    figure = draw_before_after(steps, 5e-5)
    assert [axis.get_title() for axis in figure.axes] == [
        "mean",
        "RMS",
        "95th percentile",
        "maximum",
    ]
    assert {axis.get_xlabel() for axis in figure.axes} == {"error (µm)"}
    first = figure.axes[0]
    assert row_labels(first) == [
        "frames and targets",
        "declared model",
        "with lost motion\n(backlash)",
    ]
    assert (
        first.get_yticks().tolist() == sorted(first.get_yticks())
        and first.get_ylim()[0] > first.get_ylim()[1]
    )
    for axis, metric in zip(figure.axes, METRICS, strict=True):
        assert [bar.get_width() for bar in axis.patches] == pytest.approx(
            [1e6 * step[f"heldout_{metric}_m"] for step in steps]
        )
        assert [len(lines_of(axis, gid)) for gid in ("interval", "noise floor")] == [
            len(steps),
            1,
        ]
        diamonds = [
            line.get_xydata()[0].tolist()
            for line in axis.lines
            if line.get_marker() == "D"
        ]
        rows = [bar.get_y() + bar.get_height() / 2 for bar in axis.patches]
        expected = [
            [1e6 * step[f"train_{metric}_m"], row]
            for step, row in zip(steps, rows, strict=True)
        ]
        assert diamonds == [pytest.approx(point) for point in expected]


def test_an_interval_reaches_from_end_to_end_or_is_not_drawn():
    steps = step_rows(effects=())
    mean, *_, largest = draw_before_after(steps).axes
    for step, (lower, upper) in zip(steps, lines_of(mean, "interval"), strict=True):
        assert [lower[0], upper[0]] == pytest.approx(
            [1e6 * step["heldout_mean_m_low"], 1e6 * step["heldout_mean_m_high"]]
        )
    assert np.isnan(
        [x for line in lines_of(largest, "interval") for x, _ in line]
    ).all()


TABLE = pd.DataFrame(
    {
        "campaign": ["ur10_a_on_b", "wam_grid"],
        "poses": [24, 1],
        **{
            f"before_rms{end}_mm": values
            for end, values in (
                ("", [0.4, 2.0]),
                ("_low", [0.3, 1.8]),
                ("_high", [0.5, np.inf]),
            )
        },
        **{
            f"after_rms{end}_mm": values
            for end, values in (
                ("", [0.2, 1.9]),
                ("_low", [0.1, 1.7]),
                ("_high", [0.3, 2.2]),
            )
        },
    }
)


def test_each_campaign_has_both_errors_at_their_values():
    (axis,) = draw_errors_by_campaign(TABLE).axes
    assert row_labels(axis) == ["UR10 A, judged on B", "WAM grid poses"]
    before, after = (container.lines[0].get_xydata() for container in axis.containers)
    np.testing.assert_allclose(before, [[0.4, 1], [2.0, 0]])
    np.testing.assert_allclose(after, [[0.2, 1], [1.9, 0]])
    assert all(
        np.isfinite(line.get_segments()).all()
        for container in axis.containers
        for line in container.lines[2]
    )
    # Sessions of one campaign are distinguished by their numbers of poses.
    assert row_labels(
        draw_errors_by_campaign(TABLE.assign(campaign="fanuc_joint")).axes[0]
    ) == [
        "FANUC both sessions, 24 poses",
        "FANUC both sessions, 1 pose",
    ]


def test_each_hypothesis_has_a_bar_as_long_as_its_probability():
    figure = draw_probabilities(stated(), candidate_table())
    axis = figure.axes[0]
    assert axis.get_xlabel() == "posterior probability (%)"
    named = [label.get_text().replace("\n", " ") for label in axis.get_yticklabels()]
    assert named == [
        "Lost motion (backlash) of joint 3",
        "Bearing tilt of joint 2",
        "Nothing is missing",
        "Everything else",
    ]
    assert [bar.get_width() for bar in axis.patches] == pytest.approx([94, 5, 0.4, 0.6])
    assert [plainly(text.get_text()) for text in axis.texts] == [
        "94 %",
        "5 %",
        "< 1 %",
        "1 %",
    ]
    certain = draw_probabilities(
        stated([({"lost_motion": ["joint 3"]}, 0.9961), ({}, 0.0039)]),
        candidate_table(count=3),
    ).axes[0]
    assert [plainly(text.get_text()) for text in certain.texts] == ["> 99 %", "< 1 %"]


def test_leading_hypotheses_have_their_bars_and_all_others_have_one_together():
    sets = [({f"effect_{number}": []}, 0.1) for number in range(10)]
    axis = draw_probabilities(stated(sets), candidate_table()).axes[0]
    assert [bar.get_width() for bar in axis.patches] == pytest.approx([10] * 8 + [20])


def test_a_candidate_is_outlined_whatever_its_shape_in_the_most_probable_model():
    table = candidate_table(count=3, chosen=0)
    # The most probable model has the first candidate in a shape that fits worse alone.
    table["candidate"][2] = table["candidate"][0]
    table["chosen"][2] = True
    figure = draw_probabilities(stated(), table)
    factors = figure.axes[1]
    outlines = [bar for bar in factors.patches if bar.get_gid() == "chosen"]
    assert [bar.get_width() for bar in outlines] == [table["log_bayes_factor"][0]]
    assert "in the most probable model" in legend_entries(figure)


def test_ticks_of_a_square_root_axis_are_round_numbers():
    axis = draw_probabilities(stated(), candidate_table()).axes[1]
    assert axis.get_xticks().tolist() == [0, 2, 10, 20, 50, 100]


def test_a_figure_states_that_no_candidate_can_be_tested():
    figure = draw_probabilities(stated([({}, 1.0)]), candidate_table(count=0, chosen=0))
    assert texts(figure) == [
        "None of 5 candidate causes can be tested with these measurements."
    ]


def test_the_budget_has_a_bar_for_each_line_that_is_not_zero_the_largest_first_from_zero_on():
    budget = make_document()["budget"]
    figure = draw_budget_bars(budget, [line["name"] for line in budget], 2e-4, 1.5e-4)
    axis = figure.axes[0]
    assert row_labels(axis) == [
        "before",
        "joint_compliance",
        "lost_motion",
        "noise of the tracker alone",
        "uncertainty of the parameters",
    ]
    np.testing.assert_allclose(
        [patch.get_width() for patch in axis.patches], [1.5, 1.0, 0.2, 0.15, 0.02]
    )
    assert axis.get_xlim()[0] == 0.0
    assert "square-root scale" in axis.get_xlabel()
    assert "tolerance 0.2 mm" in legend_entries(figure)
    assert_nothing_cut_off(figure)
