"""Intrinsic parameters of a camera, in the file that the tools of ROS and OpenCV write.

The file (camera_info) has the keys ``camera_matrix`` and ``distortion_coefficients``.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from elastocal.errors import InputError
from elastocal.io.documents import read_document

_ALLOWED = "a list of numbers under data, as ROS writes camera_info"


@dataclass(frozen=True)
class Camera:
    """Intrinsic parameters.

    Attributes
    ----------
    matrix : (3, 3) array, pixels.
    distortion : coefficients, as OpenCV orders them.
    size : width and height of an image in pixels; None if the file states none.
    """

    matrix: np.ndarray
    distortion: np.ndarray
    size: tuple[int, int] | None = None


def read_camera(path: str | Path) -> Camera:
    """Read a file of intrinsic parameters.

    Raises `InputError`: a list of numbers is missing or has another length.
    """
    document = read_document(path)
    matrix = _read_numbers(document, "camera_matrix", path)
    distortion = _read_numbers(document, "distortion_coefficients", path)
    if matrix.size != 9:
        count = f"{matrix.size} numbers"
        raise InputError(path, "camera_matrix", count, "9 numbers, row by row")
    matrix = matrix.reshape(3, 3)
    if not (matrix[0, 0] > 0.0 and matrix[1, 1] > 0.0 and matrix[2, 2] == 1.0):
        entries = (
            f"fx {matrix[0, 0]:g}, fy {matrix[1, 1]:g}, last number {matrix[2, 2]:g}"
        )
        allowed = "positive focal lengths in pixels, and 1 as the last number"
        raise InputError(path, "camera_matrix", entries, allowed)
    size = None
    if "image_width" in document and "image_height" in document:
        size = (int(document["image_width"]), int(document["image_height"]))
    return Camera(matrix, distortion, size)


def format_camera(camera: Camera) -> str:
    """Return the text of a file that `read_camera` reads."""
    document: dict[str, Any] = {}
    if camera.size is not None:
        document = {"image_width": camera.size[0], "image_height": camera.size[1]}
    for key, numbers in (
        ("camera_matrix", camera.matrix),
        ("distortion_coefficients", camera.distortion.reshape(1, -1)),
    ):
        rows, columns = numbers.shape
        data = numbers.ravel().tolist()
        document[key] = {"rows": rows, "cols": columns, "data": data}
    text: str = yaml.safe_dump(document, sort_keys=False)
    return text


def _read_numbers(document: Any, key: str, path: str | Path) -> np.ndarray:
    """Read the list of numbers of one key."""
    try:
        numbers = np.asarray(document[key]["data"], float).ravel()
    except (KeyError, TypeError, ValueError):
        raise InputError(path, key, "no numbers", _ALLOWED) from None
    if not np.isfinite(numbers).all():
        raise InputError(path, key, "a number that is not finite", _ALLOWED)
    return numbers
