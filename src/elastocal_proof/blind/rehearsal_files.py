"""Files of a rehearsal: the sheet that the simulated robot fills in, a path to mill, and by how much the robot misses it."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
from scipy.spatial.transform import Rotation

from elastocal.errors import InputError
from elastocal.exchange.csv_dialect import LARGEST_BYTES
from elastocal.exchange.target_path import read_target_path
from elastocal.io.atomic_writes import atomic_write, check_places
from elastocal.io.texts import read_text
from elastocal.mechanics.components import WRENCH_NAMES
from elastocal_proof.blind.closed_loop import bow
from elastocal_proof.blind.rehearsal import errors_along_path, filled_sheet, require_numbers, with_lost_beam
from elastocal_proof.plant.campaigns import usual_force_N

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path
    from typing import Any

    from elastocal.mechanics.robot import Robot
    from elastocal_proof.plant.physical_robot import PhysicalRobot

# A path to mill: its width over the reach, and its poses.
_BOW, _BOW_POSES = 0.2, 50


def fill_sheet(path: Path, document: Mapping[str, Any], robot: PhysicalRobot, seed: int) -> int:
    """Fill the measurement sheet at `path` as `filled_sheet` does; returns how many measurements it has now."""
    check_places(path)
    filled = filled_sheet(_read_table(path), document, robot, seed, path.as_posix())
    with atomic_write(path) as partial:
        filled.to_csv(partial, index=False)
    return len(filled)


def lose_beam(path: Path, seed: int) -> int:
    """Read zeros, as after a lost beam, in one row of a filled sheet, which is drawn; returns its line."""
    sheet, row = with_lost_beam(_read_table(path), seed)
    with atomic_write(path) as partial:
        sheet.to_csv(partial, index=False)
    return row + 2


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


def measured_errors(path: Path, targets: Path, robot: PhysicalRobot, seed: int) -> dict[str, np.ndarray]:
    """Distances (N,), m, of where the tracker sees the robot from the wanted poses, in the campaign's frame of the base.

    Commanded by "uncorrected" and by "corrected" targets; "noise alone" is what the tracker's noise and the robot's
    repeatability leave of an exact model. `path`: the wanted poses. `targets`: what `elastocal correct` wrote for them.
    """
    wanted, table = read_target_path(path, robot.arm.joints), _read_table(targets)
    if len(table) != len(wanted):
        raise InputError(targets.as_posix(), "rows", str(len(table)), f"{len(wanted)}, the poses of {path}")
    wrench = np.zeros((len(wanted), 6)) if wanted.wrench is None else wanted.wrench
    off = {}
    for name, ending in (("uncorrected", "_uncorrected"), ("corrected", "")):
        columns = [f"q{joint}{ending}" for joint in range(1, robot.arm.joints + 1)]
        require_numbers(table, columns, targets.as_posix())
        angles = table[columns].to_numpy(float)
        off[name], noise = errors_along_path(robot, angles, wrench, wanted.position, seed, targets.as_posix())
    return off | {"noise alone": noise}


def _read_table(path: Path) -> pd.DataFrame:
    try:
        return pd.read_csv(io.StringIO(read_text(path, LARGEST_BYTES)))
    except (pd.errors.EmptyDataError, pd.errors.ParserError) as error:
        raise InputError(path.as_posix(), "table", str(error).strip().splitlines()[-1], "columns under one header") from error
