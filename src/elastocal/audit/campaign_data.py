"""Simulated campaigns: joint angles, loads and noise from their stream, poses of the elastic arm by pinocchio."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin
import yaml

from elastocal.audit.arm import Arm
from elastocal.audit.audited import WRENCH
from elastocal.audit.findings import Finding, compared
from elastocal.audit.streams import numbers

if TYPE_CHECKING:
    from pathlib import Path

    from elastocal.audit.audited import Audited

# Positions are some metres, rotations some radians; near half a turn rotation vectors lose digits.
_DIGITS = 1e-10


def simulated(run: Audited, file: str, campaign: str) -> list[Finding]:
    """Every measurement of a simulated campaign.

    Returns nothing of campaigns that people have measured.
    """
    source = _document(run.folder / f"config/campaigns/{campaign}.yaml")
    if source.get("source") != "simulated":
        return []
    document, table = _document(run.folder / f"config/robots/{source['robot']}.yaml"), run.table(file)
    arm, draws = Arm(document), numbers(run.seed, campaign, "campaign", 0)
    low, high = np.deg2rad(document["joint_limits_deg"]).T
    angles = low + (high - low) * draws.random((source["poses"], arm.joints))
    normal = draws.standard_normal((source["poses"], 3))
    forces = source["force_N"] * normal / np.linalg.norm(normal, axis=1)[:, None]
    visits = [
        (pose, load, repeat)
        for pose in range(source["poses"])
        for load in range(len(source["ladder"]))
        # Without load and under the whole one the first poses are approached again and again.
        for repeat in range(source["repeats"] if pose < source["repeated_poses"] and load < 2 else 1)
    ]
    wrenches, loaded = [], []
    for pose, load, _ in visits:
        force = source["ladder"][load] * forces[pose]
        wrenches.append(np.concatenate([force, np.cross(source["offset_m"], force)]))
        torques = arm.torques(angles[pose], wrenches[-1], arm.end_effector, "end_effector")
        loaded.append(arm.unloaded(angles[pose]) + arm.springs @ torques)
    of_pose = angles[[pose for pose, _, _ in visits]]
    found = []
    for point in source["points"]:
        position, turned = (draws.standard_normal((len(visits), 3)) for _ in range(2))
        rows = table[table["target"] == point]
        exact = [arm.pose(coordinates, point) for coordinates in loaded]
        seen = [
            (*(place + source["noise_m"] * off), *pin.log3(pin.exp3(source["noise_rad"] * turn) @ rotation))
            for (place, rotation), off, turn in zip(exact, position, turned, strict=True)
        ]
        columns: dict[str, tuple[list[str], Any]] = {
            "visits": (["pose", "load", "repeat"], visits),
            "joint angles": ([f"q{j}" for j in range(1, arm.joints + 1)], of_pose),
            "wrenches": (list(WRENCH), wrenches),
            "measured poses": (["x", "y", "z", "rx", "ry", "rz"], seen),
        }
        for words, (names, expected) in columns.items():
            checked = f"{words} of {point}"
            found.append(compared(file, checked, "pinocchio, numpy's Philox stream", rows[names], expected, _DIGITS))
    return found


def _document(path: Path) -> dict[str, Any]:
    return dict(yaml.safe_load(path.read_text("utf-8"))) if path.is_file() else {}


CHECKS = ((re.compile(r"data/campaigns/([^/]+)/measurements\.parquet"), simulated),)
