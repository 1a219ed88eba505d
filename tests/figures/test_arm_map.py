"""The map of the arm: places where they are, coloured by what the table has."""

import numpy as np
import pytest
from drawn_figures import assert_nothing_cut_off, texts_in_axes
from made_study_tables import TITLES, places

from elastocal.figures.arm_map import arm_map

OUTLINES = {name: np.array([[0, 0, 0], [0, 0, 1.0], [1.0, 0, 1.0], [2.0, 0, 1.0]]) for name in TITLES}


def test_places_lie_along_the_arm_with_the_mean_over_the_sides_and_the_best_view():
    figure = arm_map(places(), OUTLINES, TITLES)
    kuka = figure.axes[0]
    assert kuka.get_title() == "Kuka"
    first, second = kuka.collections
    # 1.5 m along the chain: half a metre out on the level link.
    np.testing.assert_allclose(first.get_offsets(), [[0.5, 1.0]])
    np.testing.assert_allclose(second.get_offsets(), [[2.0, 1.0]])
    assert first.get_array().tolist() == pytest.approx([1.41])
    assert texts_in_axes(figure)[:2] == ["1.41, seen 50 %", "1.06, seen 30 %"]
    assert_nothing_cut_off(figure)
