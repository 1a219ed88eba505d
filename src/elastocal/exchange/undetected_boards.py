"""Why no image shows the board that ``board.yaml`` describes.

OpenCV detects the corners of a chessboard only if its markers lie as the description says.
The markers alone are therefore looked for as described, in mirrored images, and in other
dictionaries.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from elastocal.errors import InputError
from elastocal.exchange.board_pattern import CHARUCO, BoardPattern

# Number of images that are searched again. A wrong description concerns all images.
SEARCHED_IMAGES = 3
# Fewest markers in an image that count as seen. OpenCV sometimes takes one or two pieces
# of a pattern for markers of another dictionary.
_FEWEST_MARKERS = 4
# The largest common dictionaries of each marker size; smaller ones are parts of them.
_OTHER_DICTIONARIES = (
    "DICT_4X4_250",
    "DICT_5X5_250",
    "DICT_6X6_250",
    "DICT_7X7_250",
    "DICT_APRILTAG_36h11",
    "DICT_ARUCO_ORIGINAL",
)


def explain_undetected_board(
    paths: Sequence[Path], images: Sequence[np.ndarray], pattern: BoardPattern
) -> InputError:
    """Return the error of images none of which shows the board.

    Parameters
    ----------
    paths : all images.
    images : grey values of the first ones.
    pattern : the board that was looked for.
    """
    found, allowed = _find_reason(paths, images, pattern)
    return InputError(paths[0].parent, "", found, allowed)


def _find_reason(
    paths: Sequence[Path], images: Sequence[np.ndarray], pattern: BoardPattern
) -> tuple[str, str]:
    """Find out what was found instead of the board, and what is allowed."""
    mirrored = [np.ascontiguousarray(np.fliplr(image)) for image in images]
    described = pattern.dictionary
    board = f"board of {pattern.columns} x {pattern.rows} squares"
    if (seen := _find_markers(images, described)) is not None:
        found = (
            f"no {board}, though its markers ({described}) are in {paths[seen].name}"
        )
        if pattern.kind == CHARUCO:
            return found, "columns and rows in board.yaml as they are printed"
        return found, "sharp images in which the board fills half of the image"
    if (seen := _find_markers(mirrored, described)) is not None:
        found = f"mirrored images: {paths[seen].name} shows the board if it is flipped"
        return found, "images as the camera takes them, not flipped"
    for other in _OTHER_DICTIONARIES:
        if (seen := _find_markers(images, other)) is not None:
            found = f"markers of {other} in {paths[seen].name}, none of {described}"
            return found, "kind and dictionary in board.yaml as they are printed"
    allowed = "sharp images in which the board of board.yaml fills half of the image"
    return f"no marker of {described} in any image", allowed


def _find_markers(images: Sequence[np.ndarray], dictionary: str) -> int | None:
    """Return the number of the first image with markers of a dictionary."""
    import cv2

    aruco: Any = cv2.aruco
    known_markers = aruco.getPredefinedDictionary(getattr(aruco, dictionary))
    detector = aruco.ArucoDetector(known_markers)
    for number, image in enumerate(images):
        markers, _, _ = detector.detectMarkers(image)
        if len(markers) >= _FEWEST_MARKERS:
            return number
    return None
