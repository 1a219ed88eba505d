"""A sheet of paper in millimetres: labels find free places, rows fill, and the page is cut to what is drawn."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from elastocal.figures.scheme_sheet import MARGIN_MM, WIDTH_MM, Sheet, fill_rows

UP = np.array([0.0, 1.0])
PLACE = np.zeros(2)


def label_of(sheet, gid):
    """Text and frame of a label, and its leader's ends or None."""
    text = next(artist for artist in sheet.axes.texts if artist.get_gid() == gid)
    frames = [patch for patch in sheet.axes.patches if patch.get_gid() == f"{gid}-box"]
    leaders = [line.get_xydata() for line in sheet.axes.lines]
    return np.array(text.get_position()), frames, leaders


def overlaps(one, other):
    return bool((one[:2] < other[2:]).all() and (other[:2] < one[2:]).all())


@settings(max_examples=10)
@given(st.lists(st.floats(0.1, 12), min_size=1, max_size=12), st.floats(0, 3))
def test_no_row_is_too_wide_and_none_has_room_for_the_next(widths, gap):
    rows = fill_rows(widths, 10.0, gap)
    assert [index for row in rows for index in row] == list(range(len(widths)))

    def width(row):
        return sum(widths[i] for i in row) + gap * (len(row) - 1)

    assert all(len(row) == 1 or width(row) <= 10 + 1e-9 for row in rows)
    assert all(width([*row, later[0]]) > 10 - 1e-9 for row, later in pairwise(rows))


def test_labels_keep_off_what_is_drawn_and_off_each_other():
    sheet = Sheet()
    sheet.take(np.array([-20.0, 4.0]), np.array([90.0, 4.0]), 2.0)
    taken = len(sheet.taken)
    for number in range(4):
        sheet.label(f"$l_{{{number}}}$ = 100 mm", [np.array([24.0 * number, 0.0])], UP, (1.2, 6.0), f"length-{number}")
    boxes = sheet.taken
    labels = [np.concatenate([box[:2] + 1e-9, box[2:] - 1e-9]) for box in boxes if box[3] - box[1] == pytest.approx(4.6)]
    assert len(labels) == 4
    for number, box in enumerate(labels):
        assert not any(overlaps(box, other) for other in [*boxes[:taken], *labels[:number]])


def test_a_label_that_had_to_move_away_has_a_leader_to_its_anchor():
    sheet = Sheet()
    sheet.take(np.array([-9.0, 0.0]), np.array([9.0, 0.0]), 4.0)
    sheet.label("TCP", [PLACE], UP, (3.0, 4.0), "point-TCP", frame="red")
    at, (frame,), (leader,) = label_of(sheet, "point-TCP")
    assert leader[0].tolist() == [0, 0]
    corner = np.array([frame.get_x(), frame.get_y()])
    extent = np.array([frame.get_width(), frame.get_height()])
    np.testing.assert_allclose(corner + extent / 2, at, atol=1e-9)
    # It ends at the frame's edge.
    gap = np.abs(leader[1] - at) - extent / 2
    assert 0 <= gap.max() < 0.5


@pytest.mark.parametrize("width, page", [(50.0, WIDTH_MM), (200.0, 200.0 + 2 * MARGIN_MM)])
def test_the_page_is_cut_to_the_drawing_in_its_middle_and_a_millimetre_is_a_millimetre(width, page):
    sheet = Sheet()
    figure = sheet.finish((10.0, -5.0), (10.0 + width, 25.0))
    np.testing.assert_allclose(25.4 * figure.get_size_inches(), [page, 30.0 + 2 * MARGIN_MM])
    (left, right), (low, high) = sheet.axes.get_xlim(), sheet.axes.get_ylim()
    assert (left + right) / 2 == pytest.approx(10 + width / 2) and right - left == pytest.approx(page)
    assert (low, high) == (-5.0 - MARGIN_MM, 25.0 + MARGIN_MM)
    np.testing.assert_allclose(sheet.axes.get_position().bounds, (0, 0, 1, 1))
