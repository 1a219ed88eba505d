"""Folders of small campaigns, as a user with a robot and a tracker would write them."""

from pathlib import Path

import numpy as np
import yaml

from elastocal.campaigns.simulation import Plan, draw_measurements
from elastocal.campaigns.writing import write_campaign

PLAN = Plan(("3DoF", "6DoF"), 14, 800.0, (0, 1), (0.0, 0.5, 0.0), 2, 4, 6e-5, 6e-5)


def make_table(robot, name, seed=1, plan=PLAN, offset_of_joint_3=0.0):
    """Simulate measurements, in random order, of a robot whose third joint has an
    offset."""
    table = draw_measurements(robot, plan, seed, name)
    table["q3"] = table["q3"] - offset_of_joint_3
    order = np.random.default_rng(seed).permutation(len(table["pose"]))
    return {column: np.asarray(values)[order] for column, values in table.items()}


def make_folder(folder, robot, /, name="made", kind="csv", table=None, **changes):
    """Write the folder of a campaign."""
    table = make_table(robot, name) if table is None else table
    document = yaml.safe_load(
        Path(__file__).with_suffix(".yaml").read_text(encoding="utf-8")
    )
    write_campaign(
        folder, document | {"campaign": name} | changes, table, robot.joints, kind
    )
    return folder
