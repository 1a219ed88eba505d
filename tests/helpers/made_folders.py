"""Folders of small campaigns, as a user of a robot and a tracker would bring them."""

import numpy as np

from elastocal.campaigns.simulation import Plan, draw_measurements
from elastocal.campaigns.writing import write_campaign

PLAN = Plan(("3DoF", "6DoF"), 14, 800.0, (0, 1), (0.0, 0.5, 0.0), 2, 4, 6e-5, 6e-5)


def made_document(name, **changes):
    """Description of a campaign of `made_table`."""
    document = {
        "campaign": name,
        "robot": "kuka",
        "measured": "position",
        "frame": "base",
        "targets": {point: {"point": point, "offset_m": [0, 0, 0]} for point in PLAN.points},
        "compliance": "identify",
        "declared": [],
        "noise": {"position_m": 6e-5},
        "holdout": {"fraction": 0.3, "seed": 1},
        "remainder": "none",
    }
    return document | changes


def made_table(robot, name, seed=1, plan=PLAN, offset_of_joint_3=0.0):
    """Measurements of a robot whose third joint stands beyond what it reports, in no order."""
    table = draw_measurements(robot, plan, seed, name)
    table["q3"] = table["q3"] - offset_of_joint_3
    order = np.random.default_rng(seed).permutation(len(table["pose"]))
    return {column: np.asarray(values)[order] for column, values in table.items()}


def made_folder(folder, robot, /, name="made", kind="csv", table=None, **changes):
    """A campaign's folder."""
    table = made_table(robot, name) if table is None else table
    write_campaign(folder, made_document(name, **changes), table, robot.joints, kind)
    return folder
