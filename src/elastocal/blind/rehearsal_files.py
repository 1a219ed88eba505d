"""Files of a rehearsal: the sheet that the simulated robot fills in, a path to mill, and by how much the robot misses it."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
from scipy.spatial.transform import Rotation

from elastocal.blind.closed_loop import bow
from elastocal.blind.rehearsal import filled_sheet, reached
from elastocal.exchange.csv_dialect import LARGEST_BYTES
from elastocal.exchange.target_path import read_target_path
from elastocal.io.atomic_writes import atomic_write, check_places
from elastocal.io.texts import read_text
from elastocal.mechanics.components import WRENCH_NAMES
from elastocal.plant.campaigns import usual_force_N

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path
    from typing import Any

    from elastocal.mechanics.robot import Robot
    from elastocal.plant.physical_robot import PhysicalRobot

# A path to mill: its width over the reach, and its poses.
_BOW, _BOW_POSES = 0.2, 50


def fill_sheet(path: Path, document: Mapping[str, Any], robot: PhysicalRobot, seed: int) -> int:
    """Fill the measurement sheet at `path` as `filled_sheet` does; returns how many measurements it has now."""
    check_places(path)
    sheet = pd.read_csv(io.StringIO(read_text(path, LARGEST_BYTES)))
    filled = filled_sheet(sheet, document, robot, seed, path.as_posix())
    with atomic_write(path) as partial:
        filled.to_csv(partial, index=False)
    return len(filled)


def write_milling_path(path: Path, declared: Robot, robot: PhysicalRobot, seed: int) -> int:
    """Write wanted poses along a bow as for milling, under half the usual force of such a robot; returns how many."""
    check_places(path)
    at, turned, angles = bow(declared, _BOW * robot.arm.reach_m, _BOW_POSES, np.random.default_rng(seed))
    force = np.tile([0.0, 0.0, usual_force_N(robot.arm) / 2, 0.0, 0.0, 0.0], (len(at), 1))
    names = ["x", "y", "z", "rx", "ry", "rz", *WRENCH_NAMES, *(f"q{j + 1}" for j in range(len(angles[0])))]
    columns = np.column_stack([at, Rotation.from_matrix(turned).as_rotvec(), force, angles])
    with atomic_write(path) as partial:
        pd.DataFrame(columns, columns=names).to_csv(partial, index=False)
    return len(at)


def missed_m(path: Path, targets: Path, robot: PhysicalRobot, seed: int) -> dict[str, np.ndarray]:
    """By how much the robot misses wanted poses, commanded by "uncorrected" and "corrected" targets; (N,), m.

    `path`: the wanted poses. `targets`: what `elastocal correct` wrote for them.
    """
    wanted = read_target_path(path, robot.arm.joints)
    table = pd.read_csv(io.StringIO(read_text(targets, LARGEST_BYTES)))
    wrench = np.zeros((len(wanted), 6)) if wanted.wrench is None else wanted.wrench
    off = {}
    for name, ending in (("uncorrected", "_uncorrected"), ("corrected", "")):
        angles = table[[f"q{joint}{ending}" for joint in range(1, robot.arm.joints + 1)]].to_numpy()
        off[name] = np.linalg.norm(reached(robot, angles, wrench, seed)[0] - wanted.position, axis=1)
    return off
