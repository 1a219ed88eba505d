"""Poses of a board in a camera, from images.

OpenCV finds the corners. The pose minimizes the squared distances between the corners
and their projections. Its covariance is the one of linear least squares, with the mean
square of these distances as the variance of a corner. The stated uncertainty therefore
grows with the range and the obliquity of the board.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from elastocal.errors import InputError, explain_missing_packages
from elastocal.exchange.board_pattern import CHARUCO, BoardPattern
from elastocal.exchange.camera_file import Camera
from elastocal.exchange.undetected_boards import (
    SEARCHED_IMAGES,
    explain_undetected_board,
)
from elastocal.mechanics.kinematics import form_cross_matrices

# Columns of the table of poses, one row for each image.
POSE_COLUMNS = ("x", "y", "z", "rx", "ry", "rz")
STD_COLUMNS = (
    "std_x_m", "std_y_m", "std_z_m", "std_rx_rad", "std_ry_rad", "std_rz_rad",
)  # fmt: skip
COLUMNS = ("image", *POSE_COLUMNS, "corners", "residual_px", *STD_COLUMNS)
SUFFIXES = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".pgm")
# A pose has six parameters; the noise is estimated from the remaining degrees of freedom.
_FEWEST_CORNERS = 6
# In a sharp image, corners are found to a tenth of a pixel. An RMS residual above this
# value means that the board is bent, or that the intrinsic parameters belong to another
# camera or resolution.
_LARGEST_RESIDUAL_PX = 2.0
# Two poses fit a flat board that is far from the camera. The better one is accepted only
# if its residual is smaller by this factor.
_AMBIGUOUS_RATIO = 1.2
# Two fits whose rotation vectors differ by less than this are the same pose.
_SAME_POSE_RAD = 1e-3
# Smallest number of images from which intrinsic parameters are determined.
_FEWEST_IMAGES = 8


@dataclass(frozen=True)
class ImageCorners:
    """Corners of a board in one image.

    Attributes
    ----------
    image : name of the file.
    on_board : (M, 3) array, m, in the frame of the board.
    in_image : (M, 2) array, pixels.
    """

    image: str
    on_board: np.ndarray
    in_image: np.ndarray


@dataclass(frozen=True)
class DetectedPose:
    """Pose of the board in the camera's optical frame, from one image.

    Attributes
    ----------
    image : name of the file.
    position : (3,) array, m.
    rotation : (3,) array, rotation vector, rad.
    corners : number of corners.
    residual_px : root mean square distance between corners and projections.
    std : (6,) array, standard deviations of position (m) and of a rotation of the board
        (rad), each in the axes of the camera.
    """

    image: str
    position: np.ndarray
    rotation: np.ndarray
    corners: int
    residual_px: float
    std: np.ndarray


@dataclass(frozen=True)
class Detection:
    """Poses of all images.

    Attributes
    ----------
    poses : those that were determined.
    camera : intrinsic parameters that they rest on.
    left_out : why an image has no pose, by its name.
    """

    poses: list[DetectedPose]
    camera: Camera
    left_out: dict[str, str]


def detect_boards(
    paths: Sequence[Path], pattern: BoardPattern, camera: Camera | None
) -> Detection:
    """Determine the pose of the board in each image.

    Parameters
    ----------
    paths : images.
    pattern : the board.
    camera : intrinsic parameters; None: determined from the same images [1]_.

    Raises
    ------
    InputError
        If an image cannot be read or has another size than the others, if too few show
        the board, or if OpenCV is not installed.

    References
    ----------
    .. [1] Zhang, A flexible new technique for camera calibration, IEEE Transactions on
       Pattern Analysis and Machine Intelligence 22, 2000.
    """
    board = pattern.make_opencv_board()
    size = None if camera is None else camera.size
    detected = []
    left_out = {}
    # A hundred images of a good camera fill a gigabyte, so only one is in memory.
    for path in paths:
        image = _read_image(path)
        size = _check_size(path, image, size)
        corners = ImageCorners(path.name, *find_corners(image, pattern, board))
        if len(corners.on_board) < _FEWEST_CORNERS:
            left_out[corners.image] = f"{len(corners.on_board)} corners"
        else:
            detected.append(corners)
    if not detected:
        images = [_read_image(path) for path in paths[:SEARCHED_IMAGES]]
        raise explain_undetected_board(paths, images, pattern)
    if camera is None:
        assert size is not None, "no image has been read"
        camera = _calibrate_camera(detected, size, paths)
    poses = []
    for corners in detected:
        pose, reason = estimate_pose(corners, camera)
        if pose is None:
            left_out[corners.image] = reason
        else:
            poses.append(pose)
    if not poses:
        reasons = "; ".join(sorted({*left_out.values()}))
        allowed = "sharp images of the board that board.yaml describes"
        raise InputError(paths[0].parent, "", f"no pose ({reasons})", allowed)
    return Detection(poses, camera, left_out)


def estimate_pose(
    corners: ImageCorners, camera: Camera
) -> tuple[DetectedPose | None, str]:
    """Estimate the pose of the board in one image.

    Returns
    -------
    The pose, or None and the reason why there is none.
    """
    best, *alternatives = _fit_poses(corners, camera)
    residual_px = float(np.sqrt(best.squares / len(corners.on_board)))
    if residual_px > _LARGEST_RESIDUAL_PX:
        return None, f"a residual of {residual_px:.1f} px"
    for alternative in alternatives:
        is_same = np.allclose(alternative.rotation, best.rotation, atol=_SAME_POSE_RAD)
        if not is_same and alternative.squares < _AMBIGUOUS_RATIO**2 * best.squares:
            return None, "two poses that fit as well"
    pose = DetectedPose(
        corners.image,
        best.position,
        best.rotation,
        len(corners.on_board),
        residual_px,
        _estimate_std(best.jacobian, best.rotation, best.squares),
    )
    return pose, ""


@dataclass(frozen=True)
class _FittedPose:
    """A pose that minimizes the distances between corners and projections.

    Attributes
    ----------
    squares : sum of the squared distances, px².
    rotation, position : (3,) arrays, rad and m.
    jacobian : (2 M, 6) array, derivative of the projections in both, px.
    """

    squares: float
    rotation: np.ndarray
    position: np.ndarray
    jacobian: np.ndarray


def _fit_poses(corners: ImageCorners, camera: Camera) -> list[_FittedPose]:
    """Fit both poses that a flat board may have [1]_, the better one first.

    References
    ----------
    .. [1] Collins and Bartoli, Infinitesimal plane-based pose estimation, International
       Journal of Computer Vision 109, 2014.
    """
    import cv2

    on_board = corners.on_board.astype(np.float64)
    in_image = corners.in_image.astype(np.float64)
    lens = (camera.matrix, camera.distortion)
    _, rotations, positions, _ = cv2.solvePnPGeneric(
        on_board, in_image, *lens, flags=cv2.SOLVEPNP_IPPE
    )
    poses = []
    for start in zip(rotations, positions, strict=True):
        rotation, position = cv2.solvePnPRefineLM(on_board, in_image, *lens, *start)
        projected, jacobian = cv2.projectPoints(on_board, rotation, position, *lens)
        difference = (projected.reshape(-1, 2) - in_image).ravel()
        squares = float(difference @ difference)
        poses.append(
            _FittedPose(
                squares, np.ravel(rotation), np.ravel(position), jacobian[:, :6]
            )
        )
    return sorted(poses, key=lambda pose: pose.squares)


def write_poses(path: str | Path, poses: Sequence[DetectedPose]) -> None:
    """Write the table of poses."""
    with open(path, "w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(COLUMNS)
        for pose in poses:
            numbers = [*pose.position.tolist(), *pose.rotation.tolist()]
            writer.writerow(
                [
                    pose.image,
                    *numbers,
                    pose.corners,
                    pose.residual_px,
                    *pose.std.tolist(),
                ]
            )


def find_images(folder: str | Path) -> list[Path]:
    """Find the images of a folder, sorted by name; numbers in names count as numbers.

    Raises `InputError`: there is none.
    """
    paths = [path for path in Path(folder).glob("*") if path.suffix.lower() in SUFFIXES]
    if not paths:
        allowed = f"a folder with images: {', '.join(SUFFIXES)}"
        raise InputError(folder, "", "no image", allowed)
    return sorted(paths, key=_split_name)


def _split_name(path: Path) -> list[tuple[int, str]]:
    """Split a name into texts and numbers, so that image 10 comes after image 9."""
    pieces = re.split(r"(\d+)", path.stem)
    return [(int(text), "") if text.isdigit() else (-1, text) for text in pieces]


def _read_image(path: Path) -> np.ndarray:
    """Read an image in grey."""
    with explain_missing_packages():
        import cv2
    image = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
    if image is None:
        raise InputError(path, "", "no image that OpenCV reads", ", ".join(SUFFIXES))
    return np.asarray(image)


def _check_size(
    path: Path, image: np.ndarray, wanted: tuple[int, int] | None
) -> tuple[int, int]:
    """Check that an image has the width and height that are wanted, if any, and return
    its own: one camera has made all images."""
    height, width = image.shape
    if wanted is not None and wanted != (width, height):
        pixels = f"{width} x {height} pixels"
        allowed = f"{wanted[0]} x {wanted[1]}, as the camera's other images"
        raise InputError(path, "", pixels, allowed)
    return width, height


def find_corners(
    image: np.ndarray, pattern: BoardPattern, board: Any
) -> tuple[np.ndarray, np.ndarray]:
    """Find the corners of the board in an image, (M, 3) and (M, 2)."""
    import cv2

    aruco: Any = cv2.aruco
    if pattern.kind == CHARUCO:
        corners, ids, _, _ = aruco.CharucoDetector(board).detectBoard(image)
    else:
        parameters = aruco.DetectorParameters()
        parameters.cornerRefinementMethod = aruco.CORNER_REFINE_SUBPIX
        detector = aruco.ArucoDetector(board.getDictionary(), parameters)
        corners, ids, _ = detector.detectMarkers(image)
    if ids is None or len(ids) == 0:
        return np.zeros((0, 3)), np.zeros((0, 2))
    on_board, in_image = board.matchImagePoints(corners, ids)
    if on_board is None:
        return np.zeros((0, 3)), np.zeros((0, 2))
    return on_board.reshape(-1, 3), in_image.reshape(-1, 2)


def _calibrate_camera(
    detected: Sequence[ImageCorners], size: tuple[int, int], paths: Sequence[Path]
) -> Camera:
    """Determine the intrinsic parameters from the images of the board."""
    import cv2

    if len(detected) < _FEWEST_IMAGES:
        count = f"the board in {len(detected)} images"
        allowed = f"at least {_FEWEST_IMAGES} to calibrate the camera, or --intrinsics"
        raise InputError(paths[0].parent, "", count, allowed)
    on_board = [corners.on_board.astype(np.float32) for corners in detected]
    in_image = [corners.in_image.astype(np.float32) for corners in detected]
    no_start: Any = None
    _, matrix, distortion, _, _ = cv2.calibrateCamera(
        on_board, in_image, size, no_start, no_start
    )
    return Camera(np.asarray(matrix), np.ravel(distortion), size)


def _estimate_std(
    jacobian: np.ndarray, rotation: np.ndarray, squares: float
) -> np.ndarray:
    """Estimate the standard deviations of a pose.

    Parameters
    ----------
    jacobian : (2 M, 6) array, of projections in rotation vector and position, px.
    rotation : rotation vector of the pose.
    squares : sum of the squared residuals, px².

    Returns
    -------
    (6,) array, position and rotation about the camera's axes.
    """
    freedom = len(jacobian) - 6
    covariance = np.linalg.pinv(jacobian.T @ jacobian) * squares / freedom
    # A change of the rotation vector turns the board by the left Jacobian of SO(3).
    turn = _left_jacobian(rotation)
    transform = np.zeros((6, 6))
    transform[:3, 3:] = np.eye(3)
    transform[3:, :3] = turn
    return np.sqrt(np.diag(transform @ covariance @ transform.T))


def _left_jacobian(vector: np.ndarray) -> np.ndarray:
    """Derivative of a rotation in its rotation vector, (3, 3)."""
    angle = float(np.linalg.norm(vector))
    cross = form_cross_matrices(vector[None])[0]
    if angle < 1e-8:
        return np.eye(3) + 0.5 * cross
    first = (1.0 - np.cos(angle)) / angle**2
    second = (angle - np.sin(angle)) / angle**3
    return np.eye(3) + first * cross + second * cross @ cross


def summarize_detection(detection: Detection) -> Mapping[str, float]:
    """Return medians over the images: residual (px), and standard deviations of position
    (m) and rotation (rad), root mean square over the axes."""
    std = np.array([pose.std for pose in detection.poses])
    return {
        "residual_px": float(np.median([pose.residual_px for pose in detection.poses])),
        "position_m": float(np.median(np.sqrt((std[:, :3] ** 2).mean(axis=1)))),
        "orientation_rad": float(np.median(np.sqrt((std[:, 3:] ** 2).mean(axis=1)))),
    }
