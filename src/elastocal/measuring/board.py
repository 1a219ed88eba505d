"""Pose of a board that a camera sees, with the camera on the robot or beside it.

With the camera on the robot (eye in hand) the target is the camera and the frame of the
session is the board. With the camera beside the robot (eye to hand) the target is the
board and the frame of the session is the camera.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np

from elastocal.measuring.pose import Pose
from elastocal.measuring.protocol import NoiseShape, Prediction, Sensor
from elastocal.mechanics.kinematics import form_cross_matrices

if TYPE_CHECKING:
    from collections.abc import Mapping
    from typing import Any

# Noise of the pose of a board of 0.2 m at half a metre in a camera with 600 pixels per
# radian, whose corners are found to a tenth of a pixel: across the view and along it, and
# its tilt.
_NOISE_M = 1e-4
_NOISE_RAD = 5e-4
# Values of ``camera`` of campaign.yaml.
ON_ROBOT = "on_robot"
BESIDE_ROBOT = "beside_robot"
# Lower bound on the cosine of the obliquity; no corners are detected on a board that is
# seen more obliquely.
_GRAZING = 0.2
# Distance of the middle of a board from the optical axis of a usual image, m: half of
# the board that `elastocal board` prints.
_OFF_AXIS_M = 0.1


class Board(Pose):
    """Pose of a board in the frame of a camera."""

    name = "board"
    meaning = "pose of a board in the camera's optical frame"
    error = "position error as the camera measures it"

    is_converted = True
    sensor = Sensor(
        "camera of 600 pixels per radian and board of 0.2 m at 0.5 m",
        _NOISE_M,
        _NOISE_RAD,
    )
    # Of the board, a point and the direction out of its printed side; of a camera beside
    # the robot, its place and the direction of its view.
    place_keys: ClassVar = {"x": None, "y": None, "z": None, "nx": 0, "ny": 0, "nz": 1}
    # Diameter of the board that `elastocal board` prints; the smaller angle of view of a
    # usual depth camera; a marker of 18 mm has some ten pixels at 1 m; markers are found
    # up to about 60 degrees, and poses are accurate up to 45. `range_m` is where the noise
    # is as stated, and no bound.
    limits: ClassVar = {
        "board_m": 0.285,
        "field_of_view_deg": 42.0,
        "nearest_m": 0.3,
        "farthest_m": 1.0,
        "tilt_deg": 45.0,
        "range_m": 0.5,
    }

    def convert(
        self, position: np.ndarray, rotation: np.ndarray, options: Mapping[str, Any]
    ) -> tuple[np.ndarray, np.ndarray]:
        """Convert poses of the board in the camera to poses of the target."""
        if options.get("camera", ON_ROBOT) == BESIDE_ROBOT:
            return position, rotation
        inverse = rotation.transpose(0, 2, 1)
        return -(inverse @ position[..., None])[..., 0], inverse

    def refer_noise(
        self, position: np.ndarray, rotation: np.ndarray, options: Mapping[str, Any]
    ) -> dict[str, Any]:
        """Locate the middle of the board, in its own frame, and find the median range.

        The middle is the point of the board's plane that is closest to the optical axes
        of all images, by least squares, because a camera is turned to the board. The
        prior that it is within the usual range of the origin matters only if the axes
        lie in this plane.
        """
        board_position, board_rotation = self.convert(position, rotation, options)
        into_board = board_rotation.transpose(0, 2, 1)
        camera = -(into_board @ board_position[..., None])[..., 0]
        axis = into_board[:, :, 2]
        across = np.eye(3) - axis[:, :, None] * axis[:, None, :]
        prior = np.eye(2) * (_OFF_AXIS_M / self.limits["range_m"]) ** 2
        target = np.einsum("mij,mj->i", across, camera)[:2]
        in_plane = np.linalg.solve(across.sum(axis=0)[:2, :2] + prior, target)
        middle = np.append(in_plane, 0.0)
        sight = board_position + board_rotation @ middle
        median_m = float(np.median(np.linalg.norm(sight, axis=1)))
        return {**options, "middle_m": middle, "range_m": median_m}

    def shape_noise(
        self, position: np.ndarray, rotation: np.ndarray, options: Mapping[str, Any]
    ) -> NoiseShape | None:
        """Describe the noise of a pinhole camera that locates all corners equally well.

        The error of a corner is an angle of view. Errors of position across the optical
        axis are therefore proportional to the range. Those along the axis grow with the
        square of the range, because depth follows from the size of the board in the
        image. Errors of rotation grow with the range. Rotations about axes in the board
        also become less certain with obliquity, because an oblique board is narrower in
        the image. The rotation about the normal is the most certain one.

        These errors are those of the middle of the board, about which its rotation is
        uncertain. The origin of its frame, which is often a corner, also moves by the
        rotation times its distance from the middle.
        """
        board_position, board_rotation = self.convert(position, rotation, options)
        lever = board_rotation @ np.asarray(options.get("middle_m", np.zeros(3)))
        sight = board_position + lever
        range_m = np.linalg.norm(sight, axis=1)
        reference_m = options.get("range_m") or np.median(range_m)
        ratio = (range_m / reference_m)[:, None]
        normal = board_rotation[:, :, 2]
        cosine = np.abs((normal * sight).sum(axis=1)) / range_m
        tilting = ratio / np.maximum(cosine, _GRAZING)[:, None]
        sizes = np.hstack([ratio, ratio, ratio**2, tilting, tilting, ratio])
        axes = np.zeros((len(board_position), 6, 6))
        axes[:, :3, :3] = np.eye(3)
        axes[:, :3, 3:] = form_cross_matrices(lever) @ board_rotation
        axes[:, 3:, 3:] = board_rotation
        if options.get("camera", ON_ROBOT) == ON_ROBOT:
            # The measured pose is that of the camera on the board: the inverse of the
            # pose of the board in the camera.
            inversion = np.zeros((len(board_position), 6, 6))
            inversion[:, :3, :3] = -rotation
            inversion[:, 3:, 3:] = -rotation
            inversion[:, :3, 3:] = -rotation @ form_cross_matrices(board_position)
            axes = inversion @ axes
        return NoiseShape(axes, sizes, np.array([0, 0, 1, 2, 2, 3]))

    def aim(
        self,
        position: np.ndarray,
        rotation: np.ndarray,
        place: np.ndarray,
        options: Mapping[str, Any],
    ) -> Prediction:
        """Predict by how much the board is off the axis of the camera, as two angles, and
        how much farther or nearer than the limits it is, m.

        Derivatives of the angles are those at the axis.
        """
        in_camera, _ = self._locate_board(position, rotation, options)
        range_m = np.linalg.norm(in_camera, axis=1)
        across = np.linalg.norm(in_camera[:, :2], axis=1)
        angle = np.arctan2(across, in_camera[:, 2])
        scale = angle / np.maximum(across, np.finfo(float).tiny)
        nearest, farthest = options["nearest_m"], options["farthest_m"]
        excess = range_m - range_m.clip(nearest, farthest)
        value = np.column_stack([in_camera[:, :2] * scale[:, None], excess])
        by_pose = np.zeros((len(position), 3, 6))
        by_pose[:, :, :3] = np.eye(3)
        if options.get("camera", ON_ROBOT) == ON_ROBOT:
            inverse = rotation.transpose(0, 2, 1)
            by_pose[:, :, :3] = -inverse
            by_pose[:, :, 3:] = -inverse @ form_cross_matrices(position)
        by_range = in_camera[:, None] / range_m[:, None, None] @ by_pose
        angles = by_pose[:, :2] / range_m[:, None, None]
        by_pose = np.concatenate([angles, by_range], axis=1)
        return Prediction(-value, by_pose, np.zeros((len(position), 3, 0)))

    def check_poses(
        self,
        position: np.ndarray,
        rotation: np.ndarray,
        place: np.ndarray,
        options: Mapping[str, Any],
    ) -> dict[str, np.ndarray]:
        """Check that the camera sees the whole board, near enough and not too oblique."""
        in_camera, normal = self._locate_board(position, rotation, options)
        range_m = np.linalg.norm(in_camera, axis=1)
        across = np.linalg.norm(in_camera[:, :2], axis=1)
        # A board that is tilted has an edge that is nearer, but fits into its sphere.
        radius = np.arcsin(np.minimum(0.5 * options["board_m"] / range_m, 1.0))
        angle = np.arctan2(across, in_camera[:, 2]) + radius
        cosine = -(normal * in_camera).sum(axis=1) / range_m
        half_view = np.radians(0.5 * options["field_of_view_deg"])
        return {
            "the board is not whole in the view (field_of_view_deg, board_m)": angle
            <= half_view,
            "the board is too near (nearest_m)": range_m >= options["nearest_m"],
            "the board is too far away (farthest_m)": range_m <= options["farthest_m"],
            "the board is seen too obliquely or from behind (tilt_deg)": cosine
            >= np.cos(np.radians(options["tilt_deg"])),
        }

    def _locate_board(
        self, position: np.ndarray, rotation: np.ndarray, options: Mapping[str, Any]
    ) -> tuple[np.ndarray, np.ndarray]:
        """Locate the board in the camera, (M, 3) m, with the direction (M, 3) out of its
        printed side, which is the z axis of the board here."""
        in_camera, turned = self.convert(position, rotation, options)
        return in_camera, turned[:, :, 2]


BOARD = Board()
