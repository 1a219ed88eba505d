"""Images that do not show the board of the description: what is wrong is named."""

from dataclasses import replace

import numpy as np
import pytest
from made_images import make_views, render
from support import refused

from elastocal.exchange.board_detection import detect_boards, find_images
from elastocal.exchange.board_pattern import make_pattern

cv2 = pytest.importorskip("cv2")
PRINTED = make_pattern("charuco", 6, 5, 0.03)


def write_views(folder, change):
    for number, view in enumerate(zip(*make_views(PRINTED, 2), strict=True)):
        image = change(render(PRINTED, *view, seed=number))
        cv2.imwrite(str(folder / f"{number}.png"), image)


@pytest.mark.parametrize(
    ("change", "described", "phrases"),
    [
        (np.fliplr, {}, ["mirrored images", "0.png", "not flipped"]),
        (
            np.asarray,
            {"columns": 7},
            ["no board of 7 x 5 squares", "0.png", "columns and rows"],
        ),
        (
            np.asarray,
            {"dictionary": "DICT_4X4_100"},
            ["markers of DICT_5X5_250", "none of DICT_4X4_100", "kind and dictionary"],
        ),
        (np.zeros_like, {}, ["no marker of DICT_5X5_100", "sharp images"]),
    ],
    ids=["mirrored", "columns", "dictionary", "nothing"],
)
def test_images_without_the_described_board_say_what_is_wrong(
    tmp_path, change, described, phrases
):
    write_views(tmp_path, change)
    pattern = replace(PRINTED, **described)
    with refused(tmp_path, "", *phrases):
        detect_boards(find_images(tmp_path), pattern, None)
