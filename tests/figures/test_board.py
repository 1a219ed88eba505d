"""A printed board has the size that it states, and a camera finds it."""

import io

import numpy as np
import pytest
from support import refused

from elastocal.exchange.board_detection import find_corners
from elastocal.exchange.board_pattern import make_pattern
from elastocal.figures.board import draw_board

cv2 = pytest.importorskip("cv2")
DPI = 200


def scan(figure):
    """Return what a scanner of so many dots for each inch makes of a sheet."""
    with io.BytesIO() as file:
        figure.savefig(file, format="png", dpi=DPI)
        content = np.frombuffer(file.getvalue(), np.uint8)
    return cv2.imdecode(content, cv2.IMREAD_GRAYSCALE)


@pytest.mark.parametrize(("kind", "paper"), [("charuco", "a4"), ("apriltag", "letter")])
def test_a_scan_of_the_sheet_shows_all_corners_in_their_distances(kind, paper):
    pattern = make_pattern(kind, 5, 7, 0.03)
    image = scan(draw_board(pattern, paper))
    on_board, in_image = find_corners(image, pattern, pattern.make_opencv_board())
    expected = 4 * 6 if kind == "charuco" else 4 * 5 * 7
    assert len(on_board) == expected
    # A similarity of the plane maps the corners; its scale is that of the print.
    centred = on_board[:, :2] - on_board[:, :2].mean(axis=0)
    dots = in_image - in_image.mean(axis=0)
    scale = np.sum(centred * dots) / np.sum(centred**2)
    np.testing.assert_allclose(scale, DPI / 0.0254, rtol=1e-3)
    # No corner is more than a tenth of a millimetre off.
    assert np.abs(dots - scale * centred).max() < 1e-4 * scale


def test_a_board_that_does_not_fit_is_refused():
    with refused("board", "size", "210 x 270 mm", "a4", "fewer or smaller"):
        draw_board(make_pattern("charuco", 7, 9, 0.03), "a4")
