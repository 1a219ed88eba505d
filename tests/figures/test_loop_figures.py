"""Figures of the loop show what their tables hold, with units, and nothing where there is nothing."""

from types import SimpleNamespace

import numpy as np
import pytest
from made_loop_tables import (
    FAMILIES,
    candidate_table,
    confounding_table,
    residual_table,
    step_rows,
)
from made_loop_tables import (
    probabilities as stated,
)
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import PathCollection
from matplotlib.colors import to_rgba
from matplotlib.quiver import Quiver, QuiverKey
from matplotlib.text import Text
from synthetic import equipped

from elastocal.effects.catalogue import candidates_on
from elastocal.figures import candidates as drawn
from elastocal.figures.before_after import before_after, step_name
from elastocal.figures.candidates import confounding, leading, probabilities, shortlist
from elastocal.figures.residuals import (
    arrows,
    bins_of,
    components,
    middle_of_cells,
    residuals,
    running_quartiles,
    share_explained,
)
from elastocal.figures.style import save
from elastocal.loop.diagnosis_tables import candidate_columns

LONG = ("link_elasticity@1+2+3+6[one section]", "force_misalignment[flange axes]", "transmission_harmonic@1[orders 31-36]")
LONG_SETS = [
    ({"link_elasticity": ["links 1 and 2 and 3 and 6 one section"]}, 0.7),
    ({"joint_dependent_stiffness": ["joint 5"], "transmission_harmonic": ["joint 1 orders 1-2", "joint 1 orders 3-6"]}, 0.2),
    ({"other": ["base"]}, 0.1),
]


def of_the_catalogue():
    """A candidates table with the longest names that there are."""
    table = candidate_table()
    table["candidate"][: len(LONG)] = LONG
    return table


def texts(figure):
    return [artist.get_text() for artist in figure.findobj(Text) if artist.get_text()]


def assert_nothing_cut_off(figure):
    renderer = FigureCanvasAgg(figure).get_renderer()
    figure.draw(renderer)
    for artist in figure.findobj(Text):
        # Ticks outside the limits of an axis exist and are not drawn.
        if artist.get_text() and artist.get_visible() and not is_hidden_tick(artist, figure):
            box = artist.get_window_extent(renderer)
            assert figure.bbox.padded(1).contains(*box.min), f"{artist.get_text()!r} is cut off"
            assert figure.bbox.padded(1).contains(*box.max), f"{artist.get_text()!r} is cut off"


def is_hidden_tick(artist, figure):
    drawn_ticks = set()
    all_ticks = set()
    for axis in figure.axes:
        for one, limits in ((axis.xaxis, axis.get_xlim()), (axis.yaxis, axis.get_ylim())):
            for tick in [*one.get_major_ticks(), *one.get_minor_ticks()]:
                labels = {id(tick.label1), id(tick.label2)}
                all_ticks |= labels
                if min(limits) <= tick.get_loc() <= max(limits):
                    drawn_ticks |= labels
    return id(artist) in all_ticks - drawn_ticks


def labels_of(figure):
    return [axis.get_xlabel() for axis in figure.axes if axis.get_xlabel()]


def test_residuals_have_a_panel_for_each_quantity_that_varies():
    figure = residuals(residual_table())
    assert labels_of(figure) == [f"angle of joint {joint} (°)" for joint in range(1, 7)] + ["force (N)", "time (min)"]
    assert figure.axes[0].get_ylabel() == "residual (µm)"


def test_residuals_leave_out_what_was_not_recorded_or_did_not_vary():
    table = residual_table(loaded=False, timed=False)
    table["q4"][:] = 0.3
    assert labels_of(residuals(table)) == [f"angle of joint {joint} (°)" for joint in (1, 2, 3, 5, 6)]


def test_the_joint_behind_the_residual_is_said_to_explain_it():
    figure = residuals(residual_table(poses=120, loaded=False))
    component, shares = figure.axes[1].get_title(loc="left").split(": ")
    before, after = (float(share) for share in shares.removesuffix(" %").split(" → "))
    assert component == "vertical" and before > 90 and after < 10


def test_held_out_measurements_are_marked_apart():
    table = residual_table()
    clouds = [artist for artist in residuals(table).axes[0].collections if isinstance(artist, PathCollection)]
    sizes = [len(cloud.get_offsets()) for cloud in clouds]
    assert sizes == 2 * [(~table["held_out"]).sum(), table["held_out"].sum()]


def test_one_stage_is_drawn_where_nothing_was_found():
    figure = residuals(residual_table(found=False))
    assert "with the effects found" not in texts(figure)
    assert (
        len([artist for artist in arrows(residual_table(found=False)).axes[0].get_children() if isinstance(artist, Quiver)])
        == 1
    )


def test_many_points_are_pixels():
    table = residual_table(poses=400)
    assert all(cloud.get_rasterized() for cloud in residuals(table).findobj(PathCollection) if len(cloud.get_offsets()))


def test_millimetres_where_residuals_are_large():
    table = residual_table()
    table |= {name: 100 * values for name, values in table.items() if name.startswith(("before_d", "after_d"))}
    assert residuals(table).axes[0].get_ylabel() == "residual (mm)"


def test_components_are_those_about_the_vertical_and_along_the_force():
    table = {"x": np.array([0.0, 1.0]), "y": np.array([2.0, 0.0])}
    table |= {"before_dx": np.array([1.0, 1.0]), "before_dy": np.array([2.0, 2.0]), "before_dz": np.array([3.0, 3.0])}
    table |= {"fx": np.array([0.0, 0.0]), "fy": np.array([0.0, -5.0]), "fz": np.array([0.0, 0.0])}
    expected = [[2.0, -1.0, 3.0, np.nan], [1.0, 2.0, 3.0, -2.0]]
    np.testing.assert_allclose(components(table, "before"), expected, atol=1e-12)


def test_chance_explains_nothing():
    rng = np.random.default_rng(0)
    assert share_explained(bins_of(rng.uniform(size=2000)), rng.normal(size=2000)) < 0.01
    assert share_explained(np.zeros(5, int), np.full(5, np.nan)) == 0.0


def test_no_line_crosses_a_gap():
    values = np.concatenate([np.linspace(0, 10, 200), np.linspace(50, 60, 200)])
    middle, quartiles = running_quartiles(values, np.sin(values), bins_of(values))
    assert np.isnan(quartiles).all(axis=1).sum() == 1
    assert middle[~np.isnan(quartiles[:, 1])].max() > 50
    levels = np.repeat([0.0, 1000.0], 50)
    assert not np.isnan(running_quartiles(levels, levels, bins_of(levels))[1]).any()


def test_arrows_stand_where_measurements_were_taken():
    table = residual_table(poses=20, repeats=3)
    figure = arrows(table)
    before = next(
        artist for artist in figure.axes[0].get_children() if isinstance(artist, Quiver) and artist.get_gid() == "before"
    )
    # Repeats are averaged: one arrow for each pose, load and target.
    assert len(before.X) == 20 * 2 * 2
    assert [axis.get_xlabel() for axis in figure.axes] == ["x (m)", "x (m)"]
    assert [axis.get_ylabel() for axis in figure.axes] == ["z (m)", "y (m)"]
    (key,) = figure.findobj(QuiverKey)
    assert key.label == "200 µm"


def test_large_campaigns_draw_one_state_of_each_cell():
    figure = arrows(residual_table(poses=500))
    quivers = [artist for artist in figure.axes[0].get_children() if isinstance(artist, Quiver)]
    assert max(len(quiver.X) for quiver in quivers) < 500
    assert any("one state of each cell" in text for text in texts(figure))


def test_the_middle_of_each_cell_is_taken():
    at = np.array([[0.1, 0.1], [0.2, 0.2], [0.3, 0.3], [5.0, 5.0]])
    assert sorted(middle_of_cells(at, np.array([3.0, 1.0, 2.0, 9.0]), 1.0)) == [2, 3]


def test_each_hypothesis_has_a_bar_as_long_as_its_probability():
    figure = probabilities(stated(), candidate_table())
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
    assert [text.get_text() for text in axis.texts] == ["94 %", "5 %", "<1 %", "1 %"]


def test_of_many_hypotheses_the_leading_have_bars_and_the_rest_has_one():
    sets = [({f"effect_{number}": []}, 0.1) for number in range(10)]
    axis = probabilities(stated(sets), candidate_table()).axes[0]
    assert [bar.get_width() for bar in axis.patches] == pytest.approx([10] * 8 + [20])


def test_leading_candidates_have_their_bayes_factor_in_the_colour_of_their_family():
    table = candidate_table()
    table["log_bayes_factor"][:2] = [40.0, 90.0]
    figure = probabilities(stated(), table)
    axis = figure.axes[1]
    assert [label.get_text() for label in axis.get_yticklabels()][:2] == ["Effect 1 of joint 2", "Effect 2 of joint 3"]
    order = [1, 2, 3, 4, 5, 6, 7, 8, 0, 9, 10, 11, 12, 13, 14]
    bars = [bar for bar in axis.patches if bar.get_gid() != "chosen"]
    assert [bar.get_width() for bar in bars] == pytest.approx(table["log_bayes_factor"][order].tolist())
    assert [bar.get_facecolor() for bar in bars] == [to_rgba(drawn.FAMILIES[table["family"][index]]) for index in order]
    assert len({*drawn.FAMILIES.values()}) == len(FAMILIES)
    # The chosen one, which the smaller factor put on another row, is outlined there.
    (outlined,) = [bar for bar in axis.patches if bar.get_gid() == "chosen"]
    assert outlined.get_width() == 40.0
    assert any("30 candidate causes tested; 5 more cannot be tested" in text for text in texts(figure))
    assert {"in the most probable model", "geometry"} <= set(texts(figure))


def test_factors_below_and_above_one_stand_on_both_sides_of_zero():
    table = candidate_table(count=15, chosen=0)
    table["log_bayes_factor"][:15] = np.linspace(3, -6, 15)
    axis = probabilities(stated([({}, 1.0)]), table).axes[1]
    low, high = axis.get_xlim()
    assert low < -6 and high > 3 and 0 in axis.get_xticks() and min(axis.get_xticks()) < 0


def test_each_candidate_stands_once_at_its_best_shape():
    table = candidate_table()
    table["candidate"][3] = table["candidate"][1]
    assert 3 not in leading(table) and 1 in leading(table)
    assert leading(table)[0] == 0


def test_confounding_annotates_every_pair_and_marks_what_was_found():
    table = candidate_table(count=12)
    figure = confounding(table, confounding_table(table))
    numbers = [artist for artist in figure.axes[0].texts if artist.get_text().isdigit()]
    assert len(numbers) == 12 * 11
    bold = [label.get_text() for label in figure.axes[0].get_yticklabels() if label.get_fontweight() == "bold"]
    assert bold == ["Effect 0 of joint 1  1"]
    assert figure.axes[1].get_ylabel() == "angle between the contributions (°)"


def test_what_was_found_is_on_the_shortlist_whatever_its_place():
    chosen = np.arange(30) == 25
    assert shortlist(list(range(30)), chosen, 5) == [0, 1, 2, 3, 25]


def test_bars_for_every_model_and_measure():
    steps = step_rows()
    figure = before_after(steps, 5e-5)
    assert [axis.get_title() for axis in figure.axes] == ["mean", "RMS", "95th percentile", "maximum"]
    assert {axis.get_xlabel() for axis in figure.axes} == {"error (µm)"}
    for axis, metric in zip(figure.axes, ("mean", "rms", "p95", "max"), strict=True):
        assert [bar.get_width() for bar in axis.patches] == pytest.approx([1e6 * step[f"heldout_{metric}_m"] for step in steps])
        assert len([line for line in axis.lines if line.get_gid() == "interval"]) == len(steps)
        assert len([line for line in axis.lines if line.get_gid() == "open interval"]) == (len(steps) if metric == "p95" else 0)
        assert len([line for line in axis.lines if line.get_gid() == "noise floor"]) == 1


def test_no_line_where_the_noise_is_not_known():
    figure = before_after(step_rows(effects=()))
    assert not [line for line in figure.axes[0].lines if line.get_gid() == "noise floor"]


def test_long_names_of_models_wrap():
    name = "+ " + ", ".join(f"transmission_harmonic@{joint}[orders 31-36]" for joint in range(1, 7))
    assert max(map(len, step_name(name).splitlines())) <= 26
    assert "and 3 more" in step_name(name).replace("\n", " ")


@pytest.mark.parametrize(
    "figure",
    [
        lambda: residuals(residual_table()),
        lambda: arrows(residual_table()),
        lambda: probabilities(stated(LONG_SETS), of_the_catalogue()),
        lambda: confounding(of_the_catalogue(), confounding_table(of_the_catalogue())),
        lambda: confounding(candidate_table(), confounding_table(candidate_table())),
        lambda: before_after(step_rows(effects=("transmission_harmonic@1[orders 31-36], transmission_ratio@2",)), 5e-6),
    ],
    ids=["residuals", "arrows", "candidates", "confounding of the catalogue", "confounding", "before_after"],
)
def test_nothing_is_cut_off_and_a_rerun_gives_the_same_bytes(figure, tmp_path):
    assert_nothing_cut_off(figure())
    for run in "ab":
        save(figure(), str(tmp_path / f"{run}.pdf"), str(tmp_path / f"{run}.png"))
    for kind in ("pdf", "png"):
        assert (tmp_path / f"a.{kind}").read_bytes() == (tmp_path / f"b.{kind}").read_bytes()


def test_where_nothing_can_be_tested_the_figures_say_so():
    table = candidate_table(count=0, chosen=0)
    for figure in (probabilities(stated([({}, 1.0)]), table), confounding(table, confounding_table(table))):
        assert texts(figure) == ["None of 5 candidate causes can be tested with these measurements."]


def test_where_the_data_are_at_fault_the_figures_say_so(kuka):
    case = SimpleNamespace(candidates=candidates_on(equipped(kuka.chain)))
    table = candidate_columns(SimpleNamespace(evidence=None, case=case))
    table = {name: np.array(values) for name, values in table.items()}
    for figure in (probabilities(None, table), confounding(table, {"one": [], "other": [], "angle_deg": np.zeros(0)})):
        assert texts(figure) == ["The data are at fault: no cause in the robot was looked for."]


def test_a_single_candidate():
    table = candidate_table(count=1)
    assert_nothing_cut_off(probabilities(stated(), table))


def test_residuals_of_one_pose_are_a_note():
    table = residual_table(loaded=False, timed=False)
    table |= {f"q{joint}": np.full(len(table["pose"]), 0.3) for joint in range(1, 7)}
    assert any("nothing to draw them against" in text for text in texts(residuals(table)))
