"""What a robot without a tracker measures: contacts with sockets, planes and spheres,
dial gauges, draw wires, and a board in a camera, each with the errors of its instrument.

A robot is only a function from joint angles to the pose of its tool, so that any model of
a robot can be measured. Contacts are found by Newton's method on the joint angles.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

# Positions (k, 3), m, and rotations (k, 3, 3) of the tool at joint angles (k, n).
Locate = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]
# Heights (k,) or one height, m, of a position (3,) over the touched feature.
Height = Callable[[np.ndarray], Any]
# Step of numerical derivatives, rad, and largest step of Newton's method, rad.
_STEP_RAD = 1e-6
_LARGEST_STEP_RAD = 0.3
_MOST_STEPS = 60
# A contact is found if it is this close, m: far below any noise.
_CLOSE_M = 1e-11
# Largest share of poses that may fail before the set-up counts as out of reach.
_MOST_TRIALS_A_POSE = 40
# Number of joint angles that are drawn at once in search of a view of a board.
_VIEWS_AT_ONCE = 1000


@dataclass(frozen=True)
class Workshop:
    """A robot that is measured.

    Attributes
    ----------
    locate : poses of the tool at joint angles.
    joint_limits : (n, 2) array, rad.
    draws : random numbers.
    approximate : fast approximation of `locate`, with which contacts are sought first;
        None if `locate` is fast itself.
    """

    locate: Locate
    joint_limits: np.ndarray
    draws: np.random.Generator
    approximate: Locate | None = None

    def draw_angles(self) -> np.ndarray:
        """Draw joint angles (n,) uniformly within the limits."""
        low, high = self.joint_limits.T
        return np.asarray(low + (high - low) * self.draws.random(len(low)))

    def find_tool(self, angles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Pose of the tool, (3,) m and (3, 3), at joint angles (n,)."""
        position, rotation = self.locate(angles[None])
        return position[0], rotation[0]

    def touch(self, height: Height) -> np.ndarray:
        """Find joint angles (n,) at which heights (k,) of the tool's position are zero.

        Starts are drawn until Newton's method arrives within the joint limits.
        """
        low, high = self.joint_limits.T
        for _ in range(_MOST_TRIALS_A_POSE):
            angles: np.ndarray | None = self.draw_angles()
            for locate in (self.approximate, self.locate):
                if locate is not None and angles is not None:
                    angles = _approach(locate, angles, height)
            if angles is not None and ((angles >= low) & (angles <= high)).all():
                return angles
        raise ValueError("the robot does not reach this contact within its limits")


def _approach(locate: Locate, angles: np.ndarray, height: Height) -> np.ndarray | None:
    """Newton's method with steps of least norm; None if it does not arrive."""
    for _ in range(_MOST_STEPS):
        steps = np.vstack([np.zeros(len(angles)), _STEP_RAD * np.eye(len(angles))])
        heights = [
            np.atleast_1d(height(position)) for position in locate(angles + steps)[0]
        ]
        distance = heights[0]
        if np.abs(distance).max() < _CLOSE_M:
            return angles
        jacobian = (np.array(heights[1:]) - distance).T / _STEP_RAD
        step = np.linalg.pinv(jacobian) @ distance
        length = np.abs(step).max()
        angles = angles - step * min(1.0, _LARGEST_STEP_RAD / max(length, 1e-12))
    return None


def seat_in_socket(workshop: Workshop, place: np.ndarray, play_m: float) -> np.ndarray:
    """Joint angles (n,) with the tool in a socket at a place (3,), m, in which it has
    play: normal, with the standard deviation `play_m` of each coordinate."""
    seat = place + play_m * workshop.draws.standard_normal(3)
    return workshop.touch(lambda position: position - seat)


def touch_plane(
    workshop: Workshop, normal: np.ndarray, height_m: float, waviness_m: float
) -> np.ndarray:
    """Joint angles (n,) with the tool on a plane, whose waviness is that of a surface
    that was lapped: normal at each point, m."""
    error = waviness_m * workshop.draws.standard_normal()
    return workshop.touch(lambda position: position @ normal - height_m - error)


@dataclass(frozen=True)
class WavyForm:
    """Heights of a surface over a plane: a sum of waves in random directions.

    Attributes
    ----------
    amplitudes : (w,) array, m.
    wave_vectors : (w, 3) array, rad/m.
    phases : (w,) array, rad.
    """

    amplitudes: np.ndarray
    wave_vectors: np.ndarray
    phases: np.ndarray

    def find_height(self, position: np.ndarray) -> float:
        """Height, m, at a position (3,), m."""
        waves = np.cos(self.wave_vectors @ position + self.phases)
        return float(self.amplitudes @ waves)


def draw_form(
    draws: np.random.Generator, std_m: float, length_m: float, count: int = 60
) -> WavyForm:
    """Draw the form of a table, whose heights have a standard deviation and a correlation
    that falls to 1/e at a distance of 1.4 lengths, as a squared exponential does."""
    return WavyForm(
        std_m * np.sqrt(2.0 / count) * np.ones(count),
        draws.standard_normal((count, 3)) / length_m,
        2.0 * np.pi * draws.random(count),
    )


def touch_surface(
    workshop: Workshop,
    place: np.ndarray,
    normal: np.ndarray,
    form: WavyForm,
    noise_m: float,
) -> np.ndarray:
    """Joint angles (n,) with the tool on a wavy surface over a place (3,), m, of a plane
    with a unit normal (3,). The contact repeats to `noise_m`."""
    along = np.linalg.svd(normal[None])[2][1:]
    error = noise_m * workshop.draws.standard_normal()

    def find_heights(position: np.ndarray) -> np.ndarray:
        from_place = position - place
        height = normal @ from_place - form.find_height(position) - error
        return np.array([*(along @ from_place), height])

    return workshop.touch(find_heights)


def touch_sphere(
    workshop: Workshop, centre: np.ndarray, radius_m: float, form_m: float
) -> np.ndarray:
    """Joint angles (n,) with the tool on a sphere with an error of form, m."""
    radius = radius_m + form_m * workshop.draws.standard_normal()
    return workshop.touch(lambda position: np.linalg.norm(position - centre) - radius)


def read_length(
    workshop: Workshop, angles: np.ndarray, anchor: np.ndarray, noise_m: float
) -> float:
    """Read a draw wire from an anchor (3,) to the tool, m."""
    length = np.linalg.norm(workshop.find_tool(angles)[0] - anchor)
    return float(length + noise_m * workshop.draws.standard_normal())


def read_gauge(
    workshop: Workshop, angles: np.ndarray, axis: np.ndarray, noise_m: float
) -> float:
    """Read a dial gauge along a unit axis (3,) on the tool, m."""
    along = workshop.find_tool(angles)[0] @ axis
    return float(along + noise_m * workshop.draws.standard_normal())


def find_view(
    workshop: Workshop,
    board: tuple[np.ndarray, np.ndarray],
    range_m: tuple[float, float] = (0.3, 0.9),
    half_angle_rad: float = 0.35,
    tilt_rad: float = 0.8,
) -> np.ndarray:
    """Draw joint angles (n,) at which a camera sees a board.

    The camera is the tool and looks along its z; the board, (3,) m and (3, 3) in base
    axes, is seen from the side to which its z does not point. The middle of the board is
    within a range and an angle from the axis of the camera, its normal within an angle
    from the line of sight.
    """
    for _ in range(_MOST_TRIALS_A_POSE):
        angles = np.array([workshop.draw_angles() for _ in range(_VIEWS_AT_ONCE)])
        position, rotation = workshop.locate(angles)
        sight = board[0] - position
        distance = np.linalg.norm(sight, axis=1)
        is_in_range = (distance > range_m[0]) & (distance < range_m[1])
        is_in_view = (sight * rotation[:, :, 2]).sum(axis=1) > distance * np.cos(
            half_angle_rad
        )
        is_flat = sight @ board[1][:, 2] > distance * np.cos(tilt_rad)
        seen = np.flatnonzero(is_in_range & is_in_view & is_flat)
        if len(seen):
            return np.asarray(angles[seen[0]])
    raise ValueError("the camera does not see the board within the robot's limits")


def see_board(
    workshop: Workshop,
    angles: np.ndarray,
    board: tuple[np.ndarray, np.ndarray],
    noise_rad: float,
    board_m: float,
) -> tuple[np.ndarray, np.ndarray]:
    """See a board, (3,) and (3, 3) in base axes, from a camera that is the tool.

    The angular error of a corner is the same everywhere. The error of the board across
    the view is therefore proportional to the range. The errors along the view and of the
    tilt also grow with the ratio of the range to the size of the board.

    Returns
    -------
    position : (3,) m, and rotation vector : (3,) rad, of the board in the camera
    """
    position, rotation = workshop.find_tool(angles)
    in_camera = rotation.T @ (board[0] - position)
    turned = rotation.T @ board[1]
    range_m = float(np.linalg.norm(in_camera))
    across = noise_rad * range_m
    along = across * range_m / board_m
    shift = np.array([across, across, along]) * workshop.draws.standard_normal(3)
    tilt = across / board_m * max(range_m / board_m, 1.0)
    turn = np.array([tilt, tilt, across / board_m]) * workshop.draws.standard_normal(3)
    # The board turns by these errors about its own axes, least about its normal.
    measured = Rotation.from_matrix(turned) * Rotation.from_rotvec(turn)
    return in_camera + shift, measured.as_rotvec()
