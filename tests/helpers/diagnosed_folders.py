"""Campaigns that were diagnosed, with their results where the pipeline puts them."""

import shutil

from loop_scripts import run_loop
from made_folders import made_folder, made_table


def diagnosed_folder(top, robot, robots, name="made"):
    """A campaign in `top` / name, and its results in `top` / results / name.

    Returns
    -------
    folder, results : Path
        Of the campaign; of all results.
    """
    folder = made_folder(top / name, robot, name, table=made_table(robot, name, offset_of_joint_3=3e-4))
    out = run_loop(folder, robots, top / "results" / name, ("read_campaign", "diagnose_campaign"))
    shutil.move(out / "descriptions.json", out / "campaign.json")
    return folder, top / "results"
