"""Numbers of sessions, poses, loads and repeats of measurements that do not state them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from elastocal.campaigns.holdout import number_close_points
from elastocal.mechanics.components import WRENCH_NAMES

if TYPE_CHECKING:
    from elastocal.campaigns.tables import Cells
    from elastocal.io.storage import Columns

# Joint angles that differ by less, rad, belong to one pose: a controller reports one
# standstill twice within this tolerance, and poses of a plan lie degrees apart.
SAME_POSE = 1e-3


def number_poses(cells: Cells, joint_angles: np.ndarray) -> dict[str, np.ndarray]:
    """Read session and pose; a pose that no column numbers consists of the rows with
    the same joint angles."""
    table: dict[str, Any] = {}
    if "session" in cells.columns:
        table["session"] = cells.integers("session")
    if "pose" not in cells.columns:
        table["pose"] = number_close_points(joint_angles, SAME_POSE) + 1
        return table
    labels = cells.texts("pose")
    if all(label.isdigit() for label in labels):
        table["pose"] = cells.integers("pose")
    else:
        table["pose"] = pd.factorize(pd.Series(labels))[0] + 1
    return table


def number_loads_and_repeats(cells: Cells, table: Columns) -> dict[str, np.ndarray]:
    """Read loads and repeats from their columns, or count them in the order in which
    they first appear."""
    states = pd.DataFrame(
        {
            "session": table.get("session", 0),
            "pose": table["pose"],
            "target": table["target"],
        }
    )
    if "load" in cells.columns:
        states["load"] = cells.integers("load")
    else:
        states["load"] = _number_loads(states[["session", "pose"]], table)
    if "repeat" in cells.columns:
        states["repeat"] = cells.integers("repeat")
    else:
        same_state = states.groupby(["session", "pose", "load", "target"])
        states["repeat"] = same_state.cumcount()
    return {name: states[name].to_numpy() for name in ("load", "repeat")}


def _number_loads(poses: pd.DataFrame, table: Columns) -> pd.Series[int]:
    """Number the different wrenches of each pose from 1; no wrench is load 0."""
    wrench = pd.DataFrame(
        {name: table.get(name, 0.0) for name in WRENCH_NAMES}, index=poses.index
    )
    loads = pd.concat([poses, wrench], axis=1)
    different = loads[wrench.any(axis=1)].drop_duplicates()
    different["load"] = different.groupby(["session", "pose"]).cumcount() + 1
    merged = loads.merge(different, how="left")
    return merged["load"].fillna(0).astype(np.int64)
