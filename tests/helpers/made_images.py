"""Images of a board that a camera with known parameters would take."""

import numpy as np
from scipy.spatial.transform import Rotation

from elastocal.exchange.camera_file import Camera

CAMERA = Camera(
    np.array([[900.0, 0.0, 322.0], [0.0, 905.0, 238.0], [0.0, 0.0, 1.0]]),
    np.zeros(5),
    (640, 480),
)
# Pixels of the printed board for each metre, and samples of a pixel of the camera.
PIXELS_PER_M = 8000
SAMPLES = 3


def render(pattern, vector, position, noise=2.0, seed=1):
    """Return the image (480, 640) of a board with a pose in the camera, and noise of
    some grey levels."""
    import cv2

    width, height = (round(PIXELS_PER_M * side) for side in pattern.size_m)
    sheet = pattern.make_opencv_board().generateImage((width, height))
    sheet = cv2.copyMakeBorder(
        sheet, 100, 100, 100, 100, cv2.BORDER_CONSTANT, value=255
    )
    rotation = Rotation.from_rotvec(vector).as_matrix()
    motion = np.column_stack([rotation[:, 0], rotation[:, 1], position])
    # The centre of a pixel of the sheet lies half a pixel behind its beginning.
    metres = np.array([[1.0, 0.0, -99.5], [0.0, 1.0, -99.5], [0.0, 0.0, PIXELS_PER_M]])
    metres /= PIXELS_PER_M
    half = (SAMPLES - 1) / 2
    samples = np.array([[SAMPLES, 0.0, half], [0.0, SAMPLES, half], [0.0, 0.0, 1.0]])
    homography = samples @ CAMERA.matrix @ motion @ metres
    size = tuple(SAMPLES * side for side in CAMERA.size)
    image = cv2.warpPerspective(sheet, homography, size, borderValue=120)
    image = image.reshape(480, SAMPLES, 640, SAMPLES).mean(axis=(1, 3))
    image += np.random.default_rng(seed).normal(0.0, noise, image.shape)
    return np.clip(image, 0, 255).astype(np.uint8)


def make_views(pattern, count, seed=1):
    """Return rotation vectors and positions (count, 3) in which the camera sees the
    board, oblique by 10 to 40 degrees."""
    rng = np.random.default_rng(seed)
    tilt = np.radians(rng.uniform(10, 40, count))
    direction = rng.uniform(-np.pi, np.pi, count)
    axis = np.column_stack([np.cos(direction), np.sin(direction), np.zeros(count)])
    turn = Rotation.from_rotvec(tilt[:, None] * axis)
    turn = turn * Rotation.from_rotvec(
        np.column_stack([np.zeros((count, 2)), rng.uniform(-0.5, 0.5, count)])
    )
    middle = np.array([*pattern.size_m, 0.0]) / 2
    centre = rng.uniform(-0.02, 0.02, (count, 3)) + np.array([0.0, 0.0, 0.45])
    return turn.as_rotvec(), centre - turn.apply(middle)
