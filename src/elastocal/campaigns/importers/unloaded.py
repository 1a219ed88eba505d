"""What all public campaigns have in common: a tracker's measurements of an unloaded flange, in a frame that nobody knows."""

# What such data can be fitted with at all before any physics is looked for.
_DECLARED = ("joint_offset", "link_geometry")


def unloaded_document(name, robot, measured, targets, holdout=None, noise=None, point="6DoF"):
    """Contents of ``campaign.yaml``: targets on the flange whose offsets nobody knows.

    Parameters
    ----------
    name, robot : str
    measured : {"position", "pose"}
    targets : iterable of str
    holdout, noise : dict, optional
    point : str
        Measuring point of the chain to which the targets belong: its last.

    Returns
    -------
    dict
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
