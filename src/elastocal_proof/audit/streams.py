"""Random numbers of the study, drawn again from how docs/audit.md names them, and the experiments that they give.

A stream is a Philox counter generator. Its key is the first 16 bytes of the SHA-256 of ``seed/robot``, the third word of its
counter the data set, the fourth the first 8 bytes of the SHA-256 of what the numbers are for.
"""

from __future__ import annotations

import hashlib
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from elastocal_proof.audit.audited import Audited


def numbers(seed: int, robot: str, purpose: str, data_set: int = 0) -> np.random.Generator:
    """The stream of one purpose in one data set; `robot` is the name of its file."""
    key = hashlib.sha256(f"{seed}/{robot}".encode()).digest()
    words = [int.from_bytes(key[start : start + 8], "little") for start in (0, 8)]
    use = int.from_bytes(hashlib.sha256(purpose.encode()).digest()[:8], "little")
    return np.random.Generator(np.random.Philox(key=np.array(words, np.uint64), counter=[0, 0, data_set, use]))


def draw(
    run: Audited,
    robot: str,
    data_set: int,
    count: int,
    purpose: str = "identification",
    joint_range: str = "",
    diameter: float = 1.0,
) -> tuple[np.ndarray, np.ndarray]:
    """Joint angles (count, n) and wrenches (count, 6) of a data set from its streams, whether or not a file has them."""
    arm, settings = run.arm(robot, diameter), run.configuration
    low, high = np.full(arm.joints, -np.pi), np.full(arm.joints, np.pi)
    if (joint_range or settings["interpretations"]["joint_range"]) == "limits":
        low, high = np.deg2rad(run.robots[robot]["joint_limits_deg"]).T
    turns = numbers(run.seed, robot, f"{purpose}/joint angles", data_set).random((count, arm.joints))
    normal = numbers(run.seed, robot, f"{purpose}/force", data_set).standard_normal((count, 3))
    angles = low + (high - low) * turns
    force = settings["loading"]["force_N"] * normal / np.linalg.norm(normal, axis=1)[:, None]
    lever = np.tile(np.array(settings["loading"]["offset_m"], float), (count, 1))
    if settings["interpretations"]["offset_frame"] == "tool":
        lever = np.array([arm.pose(arm.extend(q), arm.end_effector)[1] @ one for q, one in zip(angles, lever, strict=True)])
    return angles, np.concatenate([force, np.cross(lever, force)], axis=1)
