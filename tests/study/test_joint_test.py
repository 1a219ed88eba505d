"""The printed figures among studies: ranks, corrections and joint tests that hold their
level whatever the distribution, and see a difference that is large enough."""

import numpy as np
import pandas as pd
import pytest
from made_studies import studies_of

from elastocal.study.joint_test import (
    StudyReading,
    build_comparison_table,
    build_joint_row,
    collect_study_values,
    correct_step_down,
    join_members,
    list_tested_figures,
    measure_distances,
    rank_two_sided,
)

HEADS = ["table", "robot", "strategy", "quantity", "value"]


def print_figures(*rows):
    return pd.DataFrame(list(rows), columns=HEADS)


def initial_of(sets=5):
    """Deflections before calibration of 1, 2, 3 ... mm."""
    mean = 1e-3 * np.arange(1.0, sets + 1)
    return {
        "arm": pd.DataFrame(
            {"mean": mean, "mean_square": 1.25 * mean**2, "maximum": 2 * mean}
        )
    }


def test_studies_give_each_printed_figure_in_its_unit():
    figures = print_figures(
        ("2", "arm", "", "deviation_std", 1.0),
        ("3", "arm", "A", "c1", 20.0),
        ("4", "arm", "A", "k_sigma_20", 0.5),
        ("4", "arm", "A", "dev_20", 1.0),
        ("4", "arm", "A", "n_dev_2_um", 10.0),
        ("4", "other", "A", "dev_20", 1.0),
    )
    values = collect_study_values(figures, studies_of(), initial_of(), StudyReading(20))
    expected = [
        [0.5, 20.0, 0.5, 1.0, 10.0, np.nan],
        [1.0, 22.0, 0.55, 1.1, 11.0, np.nan],
        [1.5, 24.0, 0.6, 1.2, 12.0, np.nan],
    ]
    np.testing.assert_allclose(values, expected, rtol=1e-12)
    all_joints = collect_study_values(
        figures, studies_of(), initial_of(), StudyReading(20, "k_sigma")
    )
    np.testing.assert_allclose(all_joints[:, 2], [1.0, 1.1, 1.2])


def test_a_printed_figure_stands_for_the_closest_value_within_its_rounding():
    figures = print_figures(
        ("3", "arm", "A", "c1", 20.0),
        ("4", "arm", "A", "n_dev_2_um", 11.0),
        ("4", "arm", "A", "dev_20", 1.2),
    )
    studies = np.array([[20.1, 13.0, 1.2001], [20.3, 14.0, 1.2001]])
    paper = join_members(figures, studies)[0]
    np.testing.assert_allclose(paper, [20.0005, 11.5, 1.2001])


def test_inputs_fitted_figures_and_figures_of_the_text_are_not_tested():
    figures = print_figures(
        ("1", "kuka", "", "c1", 0.5),
        ("2", "kuka_extended", "", "deviation_mean", 1.7),
        ("2", "kuka_extended", "", "deviation_std", 1.1),
        ("4", "kuka", "6DoF", "dev_20", 8.0),
        ("text", "kuka", "", "ratio", 1.86),
    )
    assert [*list_tested_figures(figures).index] == [2, 3]


def test_a_p_value_is_twice_the_share_of_members_that_are_as_far_out():
    members = np.array([[3.0], [1.0], [2.0], [2.0], [4.0]])
    p_values = rank_two_sided(members)[:, 0]
    np.testing.assert_allclose(p_values, [0.8, 0.4, 1.0, 1.0, 0.4])


def test_distances_are_measured_on_the_side_of_the_member():
    """A skewed figure: the upper half scatters ten times as far as the lower one."""
    steps = np.linspace(-1.0, 1.0, 2001)
    members = np.where(steps > 0, 10 * steps, steps)[:, None]
    distances, _ = measure_distances(members)
    assert distances[0, 0] == pytest.approx(distances[-1, 0], rel=0.01)
    assert distances[0, 0] == pytest.approx(1 / 0.6827, rel=0.01)


def correct_slowly(distances):
    """The step-down procedure in the words of Westfall and Young."""
    remaining = [*np.argsort(-distances[0])]
    corrected = np.empty(distances.shape[1])
    previous = 0.0
    while remaining:
        figure = remaining[0]
        largest = distances[:, remaining].max(axis=1)
        previous = max(previous, (largest >= distances[0, figure]).mean())
        corrected[figure] = previous
        remaining.pop(0)
    return corrected


def test_the_correction_is_the_step_down_procedure():
    generator = np.random.default_rng(1)
    distances = np.abs(generator.standard_normal((40, 7)))
    distances[0, :2] += 3
    corrected = correct_step_down(distances)
    np.testing.assert_allclose(corrected, correct_slowly(distances))
    # One member alone lies as far out as the first two figures.
    assert corrected[:2].max() < 0.1


@pytest.mark.parametrize("tails", ["normal", "infinite variance"])
def test_the_joint_tests_hold_their_level_for_dependent_figures_of_any_tails(tails):
    """Of 400 papers that are draws of the simulation, 20 +- 4.4 are rejected at 5 %; the
    bound lies four standard deviations above."""
    generator = np.random.default_rng(7)
    rejected = np.zeros(2)
    figures = print_figures(*[("4", "arm", "A", "dev_20", 0.0)] * 8)
    for _ in range(400):
        common = generator.standard_normal((60, 1))
        draws = common + generator.standard_normal((60, 8))
        if tails != "normal":
            draws = draws / np.abs(generator.standard_normal((60, 1)))
        row = build_joint_row(figures.assign(value=draws[0]), draws[1:])
        rejected += np.array([row["largest_distance_p"], row["below_p"]]) <= 0.05
    assert (rejected <= 20 + 4 * 4.4).all()
    assert rejected[0] > 5


def test_a_paper_that_departs_in_one_figure_is_found_there():
    """Power: five half widths are found in every one of these draws."""
    generator = np.random.default_rng(3)
    studies = generator.standard_normal((199, 12))
    printed = np.zeros(12)
    printed[4] = 5.0
    figures = print_figures(*[("4", "arm", "A", "dev_20", 0.0)] * 12)
    figures = figures.assign(value=printed)
    row = build_joint_row(figures, studies)
    assert row["differ"] == 1
    assert row["largest_distance_p"] == pytest.approx(1 / 200)
    table = build_comparison_table(figures, figures, studies)
    assert table.p_corrected.idxmin() == 4
    # What is found lies outside of the values that could not have been seen.
    unseen = table.loc[:, "unseen_low":"unseen_high"].to_numpy()
    assert unseen[4, 1] < 5.0
    outside = (printed < unseen[:, 0]) | (printed > unseen[:, 1])
    assert [*np.flatnonzero(outside)] == [4]
    # The family has wider limits than a figure alone.
    assert (table.unseen_high > table.studies_high).all()


def test_figures_that_the_studies_lack_stay_empty():
    figures = print_figures(
        ("4", "arm", "A", "dev_20", 1.1), ("4", "other", "A", "dev_20", 1.0)
    )
    values = collect_study_values(figures, studies_of(), {}, StudyReading(20))
    table = build_comparison_table(figures, figures, values)
    assert table.p_value.notna().tolist() == [True, False]
    assert build_joint_row(figures, values)["figures"] == 1
    assert build_joint_row(figures[1:], values[:, 1:])["figures"] == 0


def test_without_a_figure_nothing_differs_and_no_p_value_is_stated():
    values = np.full((5, 2), np.nan)
    row = build_joint_row(pd.DataFrame(index=range(2)), values)
    assert row["figures"] == row["differ"] == 0
    assert np.isnan(row["largest_distance_p"]) and np.isnan(row["below_p"])
