"""Printed pattern of a board, as ``board.yaml`` describes it: a chessboard with markers
(ChArUco) [1]_ or a grid of AprilTags [2]_.

References
----------
.. [1] Garrido-Jurado, Muñoz-Salinas, Madrid-Cuevas and Marín-Jiménez, Automatic
   generation and detection of highly reliable fiducial markers under occlusion, Pattern
   Recognition 47, 2014.
.. [2] Olson, AprilTag: a robust and flexible visual fiducial system, ICRA 2011.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import yaml

from elastocal.errors import InputError, explain_missing_packages
from elastocal.io.documents import check_document, read_document

CHARUCO = "charuco"
APRILTAG = "apriltag"
# Dictionaries with enough markers for a sheet of paper, and few enough bits for a camera
# that sees the whole sheet.
DICTIONARIES = {CHARUCO: "DICT_5X5_100", APRILTAG: "DICT_APRILTAG_36h11"}
# Share of a square that a marker takes: white around it is needed to find its corners.
MARKER_SHARE = 0.75


@dataclass(frozen=True)
class BoardPattern:
    """A board; see ``board.yaml`` in the package's schemas.

    Attributes
    ----------
    kind : `CHARUCO` or `APRILTAG`.
    columns, rows : squares of a chessboard, or markers of a grid.
    square_m : side of a square, or distance of neighbouring markers' centres.
    marker_m : side of a marker.
    dictionary : set of markers, as OpenCV names it.
    """

    kind: str
    columns: int
    rows: int
    square_m: float
    marker_m: float
    dictionary: str

    @property
    def size_m(self) -> tuple[float, float]:
        """Width and height of the printed pattern."""
        width = self.columns * self.square_m
        height = self.rows * self.square_m
        if self.kind == APRILTAG:
            # No gap follows the last marker.
            gap_m = self.square_m - self.marker_m
            width -= gap_m
            height -= gap_m
        return width, height

    @property
    def markers(self) -> int:
        """Number of markers."""
        squares = self.columns * self.rows
        return squares // 2 if self.kind == CHARUCO else squares

    def make_opencv_board(self) -> Any:
        """Make OpenCV's description of the board, whose origin is its first corner.

        Raises `InputError`: OpenCV is not installed, has no such dictionary, or the
        dictionary has too few markers.
        """
        with explain_missing_packages():
            import cv2
        aruco: Any = cv2.aruco
        if not hasattr(aruco, self.dictionary):
            allowed = "a name of cv2.aruco, such as DICT_5X5_100"
            raise InputError("board", "dictionary", repr(self.dictionary), allowed)
        dictionary = aruco.getPredefinedDictionary(getattr(aruco, self.dictionary))
        available = len(dictionary.bytesList)
        if self.markers > available:
            count = f"{self.markers} markers"
            allowed = f"at most {available}, which {self.dictionary} has"
            raise InputError("board", "columns", count, allowed)
        size = (self.columns, self.rows)
        if self.kind == CHARUCO:
            return aruco.CharucoBoard(size, self.square_m, self.marker_m, dictionary)
        gap_m = self.square_m - self.marker_m
        return aruco.GridBoard(size, self.marker_m, gap_m, dictionary)


def make_pattern(kind: str, columns: int, rows: int, square_m: float) -> BoardPattern:
    """Make a board with the usual dictionary and size of markers."""
    marker_m = round(MARKER_SHARE * square_m, 6)
    return BoardPattern(kind, columns, rows, square_m, marker_m, DICTIONARIES[kind])


def read_pattern(path: str | Path) -> BoardPattern:
    """Read ``board.yaml``.

    Raises `InputError`: its schema refuses it, or markers are larger than squares.
    """
    document = read_document(path)
    check_document(document, "board", Path(path).as_posix())
    pattern = BoardPattern(**document)
    if pattern.marker_m >= pattern.square_m:
        length = f"{pattern.marker_m:g} m"
        raise InputError(path, "marker_m", length, f"less than {pattern.square_m:g}")
    return pattern


def format_pattern(pattern: BoardPattern) -> str:
    """Return the text of ``board.yaml``."""
    text: str = yaml.safe_dump(asdict(pattern), sort_keys=False)
    return (
        "# The printed board. Measure a row of its squares with a rule or a caliper,"
        "\n# and correct square_m and marker_m if the printer has changed the scale.\n"
    ) + text
