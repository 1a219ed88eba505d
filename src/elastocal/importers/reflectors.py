"""Campaigns of several reflectors on one flange, unloaded: what both FANUC sources are."""

import numpy as np

# What such data can be fitted with at all before any physics is looked for.
DECLARED = ("joint_offset", "link_geometry")


def reflector_table(pose, repeat, joint_angles, positions, session=None):
    """Columns of measurements, one row for each reflector of each reading.

    Parameters
    ----------
    pose, repeat : ndarray of int (N,)
    joint_angles : ndarray (N, n)
        rad.
    positions : dict of str to ndarray (N, 3)
        m, by reflector.
    session : int, optional
        No such column without.

    Returns
    -------
    dict of str to ndarray (N * reflectors,)
    """
    names, count = list(positions), len(pose)
    readings = np.stack([positions[name] for name in names], axis=1).reshape(-1, 3)
    rows = np.repeat(np.arange(count), len(names))
    table = {} if session is None else {"session": np.full(len(rows), session)}
    table |= {"pose": pose[rows], "load": np.zeros(len(rows), int), "repeat": repeat[rows], "target": np.tile(names, count)}
    table |= {f"q{j + 1}": angles[rows] for j, angles in enumerate(joint_angles.T)}
    return table | {axis: readings[:, i] for i, axis in enumerate("xyz")}


def reflector_document(name, robot, targets, holdout=None, noise=None):
    """Contents of ``campaign.yaml``: positions in the tracker's frame of reflectors whose offsets nobody knows.

    Parameters
    ----------
    name, robot : str
    targets : iterable of str
    holdout, noise : dict, optional

    Returns
    -------
    dict
    """
    document = {
        "campaign": name,
        "robot": robot,
        "measured": "position",
        "frame": "tracker",
        "targets": {target: {"point": "6DoF", "offset_m": "unknown"} for target in targets},
        "compliance": "nominal",
        "declared": list(DECLARED),
    }
    return document | ({"noise": dict(noise)} if noise else {}) | ({"holdout": dict(holdout)} if holdout else {})
