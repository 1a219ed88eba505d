"""Kinematics files of makers, with the geometry of a calibrated robot.

Both kinds state the frame behind each joint in the frame behind the joint before it,
``x, y, z`` in m and ``roll, pitch, yaw`` in rad, as the origin of a URDF; each joint turns
about z. The ROS drivers of Universal Robots read ``kinematics`` with six links and the
``hash`` of the robot's own calibration; the base is that of the controller, half a turn
from ``base_link``. The descriptions of Franka read ``joint1`` to ``joint7``, each with
``kinematic``, and ``joint8``, the fixed flange.

The frames of a maker's file stand on the joint axes of the nominal chain, so that the
pose G of a frame of the chain in that of the file does not depend on the joint
angles. The new origin of a joint is G C Q G'^-1, with C the calibrated fixed transform
before the joint, Q its motion if the controller reports zero, and G and G' the poses
before and behind it. Joint values mean the same before and after.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import yaml

from elastocal.errors import InputError
from elastocal.exchange.robot_text import (
    compute_yaw_pitch_roll,
    make_elementary_transform,
    make_origin_transform,
)
from elastocal.exchange.urdf_writing import split_chain
from elastocal.io.documents import check_document, read_document
from elastocal.mechanics.kinematics import compute_poses

if TYPE_CHECKING:
    from collections.abc import Mapping

    from elastocal.mechanics.chain import MeasuringPoint, Transform
    from elastocal.mechanics.robot import Robot

_KEYS = ("x", "y", "z", "roll", "pitch", "yaw")
# Links of Universal Robots in the order of the arm.
UR_LINKS: tuple[str, ...] = (
    "shoulder",
    "upper_arm",
    "forearm",
    "wrist_1",
    "wrist_2",
    "wrist_3",
)
FRANKA_JOINTS = tuple(f"joint{number}" for number in range(1, 9))
# Upper bound on the difference between the joint axes of a file and those of the chain, m
# and rad: makers state right angles to nine digits.
_ROUNDING = 1e-6
# Decimals of written origins, m and rad.
_DECIMALS = 12
# Postures at which a written file is compared with the robot.
_POSTURES = 100
_HALF_TURN = make_elementary_transform("R", 2, np.pi)
# Angles at which the frames of a file and of a chain are compared, rad.
_AT_ZERO = np.zeros(7)
_ELSEWHERE = np.linspace(0.3, 0.9, 7)


@dataclass(frozen=True)
class MakersFile:
    """A kinematics file of a maker.

    Attributes
    ----------
    document : its contents.
    names : names of the transforms, from the base.
    origins : transforms (4, 4) before each joint, then that of a fixed flange, if there
        is one.
    path : file, for messages.
    """

    document: Mapping[str, Any]
    names: tuple[str, ...]
    origins: tuple[np.ndarray, ...]
    path: str

    @property
    def is_franka(self) -> bool:
        """Whether it is a file of Franka."""
        return self.names == FRANKA_JOINTS

    @property
    def joints(self) -> int:
        """Number of moving joints."""
        return len(self.names) - self.is_franka

    def compute_frames(self, angles: np.ndarray) -> list[np.ndarray]:
        """Compute the frames (4, 4) behind each joint at angles (n,), then the last
        frame."""
        frame = np.eye(4)
        frames = []
        for origin, angle in zip(self.origins, angles, strict=False):
            frame = frame @ origin @ make_elementary_transform("R", 2, angle)
            frames.append(frame)
        for flange in self.origins[self.joints :]:
            frame = frame @ flange
        return [*frames, frame]

    def replace_origins(self, origins: list[np.ndarray]) -> str:
        """Write the file with other origins."""
        entries = {}
        for name, origin in zip(self.names, origins, strict=True):
            yaw, pitch, roll = compute_yaw_pitch_roll(origin[:3, :3])
            values = (*origin[:3, 3], roll, pitch, yaw)
            entries[name] = dict(zip(_KEYS, map(_round, values), strict=True))
        document: dict[str, Any]
        if self.is_franka:
            document = {name: {"kinematic": entry} for name, entry in entries.items()}
        else:
            stated = self.document["kinematics"]
            digest = {key: value for key, value in stated.items() if key == "hash"}
            document = {"kinematics": entries | digest}
        return yaml.safe_dump(document, sort_keys=False)


def read_makers_file(path: str | Path) -> MakersFile:
    """Read a kinematics file of Universal Robots or of Franka.

    Raises
    ------
    InputError
        It is neither, or a number is missing.
    """
    source = Path(path).as_posix()
    document = read_document(path)
    if isinstance(document, dict) and "kinematics" in document:
        check_document(document, "ros_kinematics", source)
        entries = {
            name: entry
            for name, entry in document["kinematics"].items()
            if name != "hash"
        }
        names = UR_LINKS
    else:
        check_document(document, "franka_kinematics", source)
        entries = {name: entry["kinematic"] for name, entry in document.items()}
        names = FRANKA_JOINTS
    if {*entries} != {*names}:
        finding = f"the links {', '.join(entries)}"
        raise InputError(source, "", finding, ", ".join(names))
    origins = []
    for name in names:
        values = [float(entries[name][key]) for key in _KEYS]
        origins.append(make_origin_transform(values[:3], values[3:]))
    return MakersFile(document, names, tuple(origins), source)


def correct_makers_file(original: MakersFile, nominal: Robot, calibrated: Robot) -> str:
    """Write the geometry of a calibrated robot into a kinematics file.

    Parameters
    ----------
    original : file of the same robot; the frames of its links are kept.
    nominal : robot before the calibration.
    calibrated : the same robot, calibrated.

    Returns
    -------
    Contents of the file, see `find_deviation_m`.

    Raises
    ------
    InputError
        The file has another robot.
    """
    frames = _find_frames(original, nominal)
    links = split_chain(calibrated.chain)
    zero_angles = calibrated.model_angles(np.zeros(nominal.commands))
    origins = []
    for number, fixed in enumerate(links.fixed[: len(original.origins)]):
        before = frames[number]
        behind = frames[number + 1]
        motion = np.eye(4)
        if number < nominal.joints:
            motion = _move(links.moving[number], zero_angles[number])
        origins.append(before @ fixed @ motion @ np.linalg.inv(behind))
    return original.replace_origins(origins)


def find_deviation_m(
    written: MakersFile, original: MakersFile, robots: tuple[Robot, Robot]
) -> float:
    """Find how far a written file is from the calibrated robot, m: the largest distance
    at angles over the whole range of the joints.

    A file has no place for ratios and couplings of joints, nor, at Universal Robots, for
    an error behind the last joint.

    Parameters
    ----------
    written, original : the file with the new origins, and the maker's.
    robots : nominal and calibrated robot.
    """
    nominal, calibrated = robots
    base, *_, tip = _find_frames(original, nominal)
    stream = np.random.default_rng(0)
    low, high = nominal.joint_limits.T
    chain_angles = stream.uniform(low, high, (_POSTURES, nominal.joints))
    reported = nominal.reported_angles(chain_angles)
    position, _ = compute_poses(
        calibrated.chain, calibrated.model_angles(reported), _get_flange(calibrated)
    )
    reached = []
    for angles in reported:
        last = np.linalg.inv(base) @ written.compute_frames(angles)[-1] @ tip
        reached.append(last[:3, 3])
    return float(np.linalg.norm(np.array(reached) - position, axis=1).max())


def _get_flange(robot: Robot) -> MeasuringPoint:
    """Get the origin of the last frame."""
    return replace(robot.chain.end_effector, offset_m=(0.0, 0.0, 0.0))


def _find_frames(original: MakersFile, nominal: Robot) -> list[np.ndarray]:
    """Find the poses (4, 4) of the chain's frames in those of the file: of the base,
    behind each joint, and of the last frame.

    The base of the chain may be that of the controller or ``base_link``.
    """
    if nominal.joints == original.joints:
        for base in (np.eye(4), _HALF_TURN):
            frames = _align_frames(original, nominal, base, _AT_ZERO)
            moved = _align_frames(original, nominal, base, _ELSEWHERE)
            if np.abs(np.subtract(frames, moved)).max() < _ROUNDING:
                return frames
    raise InputError(
        original.path,
        "",
        f"another robot than {nominal.name}: joints elsewhere",
        "the kinematics file of the same robot, with the base of its controller",
    )


def _align_frames(
    original: MakersFile, nominal: Robot, base: np.ndarray, angles: np.ndarray
) -> list[np.ndarray]:
    """Poses of the chain's frames in those of the file at angles (n,) as the controller
    reports them. They do not depend on the angles if both have the same joint axes."""
    links = split_chain(nominal.chain)
    reported = angles[: nominal.joints]
    chain_angles = nominal.model_angles(reported)
    made = original.compute_frames(reported)
    frame = base
    frames = [base]
    for number, moving in enumerate(links.moving):
        frame = frame @ links.fixed[number] @ _move(moving, chain_angles[number])
        frames.append(np.linalg.inv(made[number]) @ frame)
    return [*frames, np.linalg.inv(made[-1]) @ frame @ links.fixed[-1]]


def _move(moving: Transform, amount: float) -> np.ndarray:
    return make_elementary_transform(moving.kind, moving.axis, moving.sign * amount)


def _round(value: float) -> float:
    return round(float(value), _DECIMALS) + 0.0
