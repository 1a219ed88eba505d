"""Public campaigns: targets on an unloaded flange, measured by a tracker in a frame that nobody knows."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import scipy  # Its parts load as they are used: the rules ask importers for their files alone, at each start of Snakemake.

from elastocal.campaigns.writing import write_campaign

# What such data can be fitted with at all before any physics is looked for.
_DECLARED = ("joint_offset", "link_geometry")
_SIX = 6
_Reflectors = tuple[np.ndarray, Mapping[str, np.ndarray]]


def unloaded_document(
    name: str,
    robot: str,
    measured: str,
    targets: Iterable[str],
    holdout: Mapping[str, Any] | None = None,
    noise: Mapping[str, float] | None = None,
    point: str = "6DoF",
) -> dict[str, Any]:
    """Contents of ``campaign.yaml``: targets on the flange whose offsets nobody knows.

    `measured`: one of "position", "pose". `point`: measuring point of the chain to which the targets belong: its last.
    """
    document = {
        "campaign": name,
        "robot": robot,
        "measured": measured,
        "frame": "tracker",
        "targets": {target: {"point": point, "offset_m": "unknown"} for target in targets},
        "compliance": "nominal",
        "declared": list(_DECLARED),
    }
    return document | ({"noise": dict(noise)} if noise else {}) | ({"holdout": dict(holdout)} if holdout else {})


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
    """Write measured positions of one session as a campaign's folder; rows with the same joint angles repeat a pose.

    `joint_angles` (N, n): as the controller reports them, rad. `positions` (N, 3): m, by reflector; all sit on the last of n
    measuring points. `holdout`, `noise`: as in ``campaign.yaml``.
    """
    table, joints = reflector_table(*pose_and_repeat(joint_angles), joint_angles, positions), joint_angles.shape[1]
    document = unloaded_document(name, robot, "position", positions, holdout, noise, f"{joints}DoF")
    write_campaign(folder, document, table, joints)


def campaign_writer(read: Callable[[Any], _Reflectors], robots: Sequence[str], noise: Mapping[str, float] | None = None) -> Any:
    """``write_campaign`` of an importer whose files hold one session of reflectors each.

    `read`: of a file, joint angles (N, n), rad, and positions (N, 3), m, by reflector. `robots`: the robot of the files, or
    those of six and of seven joints.
    """

    def write(path: str | Path, folder: str | Path, name: str, holdout: Mapping[str, Any] | None = None) -> None:
        """Write one file of the source as a campaign's folder; `holdout` as in ``campaign.yaml``; raises as ``read`` does."""
        angles, positions = read(path)
        robot = robots[-1] if angles.shape[1] > _SIX else robots[0]
        write_reflectors(folder, name, robot, angles, positions, holdout, noise)

    return write


def pose_and_repeat(joint_angles: np.ndarray, tolerance_rad: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Number poses by their joint angles.

    Single-linkage clusters [1] by the largest difference of angles, cut at the tolerance.

    `joint_angles` (N, n): rad. `tolerance_rad`: rows whose angles all lie this close are one pose, and so is a chain of such
    rows. Returns `pose`, `repeat` (N,): poses from 0 in the order in which they first come, repeats of each from 0.

    [1] Gower, J. C. and Ross, G. J. S., Minimum spanning trees and single linkage cluster analysis, Applied Statistics 18,
        1969.
    """
    # Not at each start of Snakemake either.
    import pandas as pd

    count = len(joint_angles)
    pairs = scipy.spatial.KDTree(joint_angles).query_pairs(tolerance_rad, p=np.inf, output_type="ndarray")
    graph = scipy.sparse.coo_array((np.ones(len(pairs)), pairs.T), shape=(count, count))
    label = scipy.sparse.csgraph.connected_components(graph, directed=False)[1]
    pose = pd.Series(pd.factorize(label)[0], dtype=np.int32)
    return pose.to_numpy(), pose.groupby(pose).cumcount().to_numpy(np.int32)
