"""A diagnosed campaign with its reports, as a certificate is made of it."""

import shutil
from dataclasses import replace

from analysed_robots import ROBOTS, analysed
from loop_scripts import ANALYSIS, run_loop
from made_folders import PLAN, made_folder, made_table

REPORTS = {"verdict.json": "verdict.json", "before_after.csv": "before_after.csv", "residuals.parquet": "residuals.parquet"}


# Of which eight judge, as a pass needs.
_PLAN = replace(PLAN, poses=27)


def certified_checkout(top, name="made", offset=3e-4):
    """A checkout with a campaign that was diagnosed and judged.

    Returns
    -------
    Path
        Folder of the campaign, in `top`.
    """
    if not (top / "config").exists():
        (top / "config").mkdir()
        (top / "config" / "robots").symlink_to(ROBOTS)
        (top / "Snakefile").touch()
    robot = analysed("kuka")
    folder = made_folder(top / name, robot, name, table=made_table(robot, name, plan=_PLAN, offset_of_joint_3=offset))
    out = run_loop(folder, ROBOTS, top / "results" / "loop" / name, ANALYSIS)
    shutil.move(out / "descriptions.json", out / "campaign.json")
    reports = top / "reports" / "loop" / name
    reports.mkdir(parents=True)
    for file in REPORTS:
        shutil.move(out / file, reports / file)
    return folder
