"""Images of a printed board as a camera would take them, and joint angles beside them, to
try `elastocal detect` without a camera."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from elastocal.exchange.board_pattern import BoardPattern, read_pattern

# Focal length and size of the images, and resolution of the sheet.
FOCAL_PX = 1100.0
WIDTH_PX = 960
HEIGHT_PX = 720
PIXELS_PER_M = 4000
SEED = 1
JOINTS = 7


def render_folder(images: str, joints: str, board: str, count: int) -> None:
    """Write images of a board from several sides, and a table of joint angles.

    Parameters
    ----------
    images : folder of the images.
    joints : table of joint angles to write; they do not fit the images.
    board : board.yaml.
    count : number of images.
    """
    pattern = read_pattern(board)
    rng = np.random.default_rng(SEED)
    folder = Path(images)
    folder.mkdir(parents=True, exist_ok=True)
    names = ",".join(f"q{joint}" for joint in range(1, JOINTS + 1))
    lines = [f"image,{names}"]
    for number in range(count):
        image = render_board(pattern, rng)
        cv2.imwrite(str(folder / f"{number}.png"), image)
        angles = rng.uniform(-1.0, 1.0, JOINTS) + np.array([0, 0, 0, -2, 0, 2, 0])
        lines.append(f"{number}.png,{','.join(f'{angle:.6f}' for angle in angles)}")
    Path(joints).write_text("\n".join(lines) + "\n")


def render_board(pattern: BoardPattern, rng: np.random.Generator) -> np.ndarray:
    """Return the image of a board in a random pose before the camera."""
    width, height = pattern.size_m
    size = (round(PIXELS_PER_M * width), round(PIXELS_PER_M * height))
    sheet = pattern.make_opencv_board().generateImage(size)
    sheet = cv2.copyMakeBorder(sheet, 80, 80, 80, 80, cv2.BORDER_CONSTANT, value=255)
    rotation = Rotation.from_euler("xyz", rng.uniform(-0.6, 0.6, 3)).as_matrix()
    centre = np.array([width / 2, height / 2, 0.0])
    position = np.array([0.0, 0.0, 0.5]) - rotation @ centre
    camera = np.array(
        [
            [FOCAL_PX, 0.0, WIDTH_PX / 2],
            [0.0, FOCAL_PX, HEIGHT_PX / 2],
            [0.0, 0.0, 1.0],
        ]
    )
    metres = np.array([[1.0, 0.0, -79.5], [0.0, 1.0, -79.5], [0.0, 0.0, PIXELS_PER_M]])
    motion = np.column_stack([rotation[:, :2], position])
    homography = camera @ motion @ metres / PIXELS_PER_M
    image = cv2.warpPerspective(
        sheet, homography, (WIDTH_PX, HEIGHT_PX), flags=cv2.INTER_AREA, borderValue=120
    )
    return np.asarray(image)
