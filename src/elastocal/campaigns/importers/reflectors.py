"""Campaigns of several reflectors on one flange, unloaded: what both FANUC sources are."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from elastocal.campaigns.importers.repeats import pose_and_repeat
from elastocal.campaigns.importers.unloaded import unloaded_document
from elastocal.campaigns.writing import write_campaign

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path
    from typing import Any


def reflector_table(
    pose: np.ndarray,
    repeat: np.ndarray,
    joint_angles: np.ndarray,
    positions: Mapping[str, np.ndarray],
    session: int | None = None,
) -> dict[str, np.ndarray]:
    """Columns of measurements, one row for each reflector of each measurement.

    `pose`, `repeat` (N,) of int. `joint_angles` (N, n): rad. `positions` (N, 3): m, by reflector. `session`: no such column
    without. Returns (N * reflectors,).
    """
    names, count = list(positions), len(pose)
    measurements = np.stack([positions[name] for name in names], axis=1).reshape(-1, 3)
    rows = np.repeat(np.arange(count), len(names))
    table = {} if session is None else {"session": np.full(len(rows), session)}
    table |= {"pose": pose[rows], "load": np.zeros(len(rows), int), "repeat": repeat[rows], "target": np.tile(names, count)}
    table |= {f"q{j + 1}": angles[rows] for j, angles in enumerate(joint_angles.T)}
    return table | {axis: measurements[:, i] for i, axis in enumerate("xyz")}


def write_reflectors(
    folder: str | Path,
    name: str,
    robot: str,
    joint_angles: np.ndarray,
    positions: Mapping[str, np.ndarray],
    holdout: Mapping[str, Any] | None = None,
    noise: Mapping[str, float] | None = None,
) -> None:
    """Write measurements of one session as a campaign's folder.

    `joint_angles` (N, n): as the controller reports them, rad. `positions` (N, 3): m, by reflector. `holdout`, `noise`: as in
    ``campaign.yaml``.
    """
    table = reflector_table(*pose_and_repeat(joint_angles), joint_angles, positions)
    document = unloaded_document(name, robot, "position", positions, holdout, noise)
    write_campaign(folder, document, table, joint_angles.shape[1])
