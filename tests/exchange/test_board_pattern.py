"""Boards are described by board.yaml, and impossible ones are refused."""

import pytest
from support import refused

from elastocal.exchange.board_pattern import (
    BoardPattern,
    format_pattern,
    make_pattern,
    read_pattern,
)


@pytest.mark.parametrize("kind", ["charuco", "apriltag"])
def test_a_board_is_read_as_it_was_written(kind, tmp_path):
    pattern = make_pattern(kind, 7, 9, 0.025)
    path = tmp_path / "board.yaml"
    path.write_text(format_pattern(pattern))
    assert read_pattern(path) == pattern


def test_markers_that_leave_no_white_are_refused(tmp_path):
    path = tmp_path / "board.yaml"
    path.write_text(
        format_pattern(BoardPattern("charuco", 7, 9, 0.02, 0.02, "DICT_5X5_100"))
    )
    with refused(path, "marker_m", "0.02 m", "less than 0.02"):
        read_pattern(path)


def test_impossible_boards_are_refused():
    pytest.importorskip("cv2")
    with refused("board", "columns", "200 markers", "at most 100"):
        make_pattern("charuco", 20, 20, 0.01).make_opencv_board()
    with refused("board", "dictionary", "'DICT_MINE'", "DICT_5X5_100"):
        BoardPattern("charuco", 5, 5, 0.02, 0.01, "DICT_MINE").make_opencv_board()
