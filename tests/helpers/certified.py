"""A diagnosed campaign with its reports and the records of its jobs, from which a
certificate can be made."""

import contextlib
import shutil
from dataclasses import replace

from analysed_robots import ROBOTS, analysed
from loop_scripts import ANALYSIS, run_loop
from made_folders import PLAN, make_folder, make_table

from elastocal.campaigns.campaign_folder import read_campaign_folder
from elastocal.io.origin import Origin, list_versions
from elastocal.io.records import JobRecord, digest_inputs, write_records

# A module that counts as the origin of all results.
ENGINE = "src/engine.py"
TABLES = ("campaign.json", "training.parquet", "held_out.parquet")
DIAGNOSIS = ("diagnosis.json", "steps.parquet")
REPORTS = ("verdict.json", "before_after.csv", "residuals.parquet")
REPORT = "report.html"


# Eight of these poses judge the calibration, as many as a pass requires.
_PLAN = replace(PLAN, poses=27)


def certified_checkout(top, name="made", offset=3e-4, made=None):
    """Make a checkout with a campaign that was diagnosed and judged.

    Parameters
    ----------
    top : Path
        Folder of the checkout.
    name : str
        Name of the campaign.
    offset : float
        Offset of joint 3, rad.
    made : callable, optional
        Makes the campaign from (folder, robot, name).

    Returns
    -------
    Path
        Folder of the campaign, in `top`.
    """
    if not (top / "config").exists():
        (top / "config").mkdir()
        (top / "config" / "robots").symlink_to(ROBOTS)
        (top / "Snakefile").touch()
        (top / ENGINE).parent.mkdir()
        (top / ENGINE).write_text("'''Made it.'''\n", encoding="utf-8")
    robot = analysed("kuka")
    if made is None:
        folder = make_folder(
            top / name,
            robot,
            name,
            table=make_table(robot, name, plan=_PLAN, offset_of_joint_3=offset),
        )
    else:
        folder = made(top / name, robot, name)
    out = run_loop(folder, ROBOTS, top / "results" / "loop" / name, ANALYSIS)
    shutil.move(out / "descriptions.json", out / "campaign.json")
    reports = top / "reports" / "loop" / name
    reports.mkdir(parents=True)
    for file in REPORTS:
        shutil.move(out / file, reports / file)
    (reports / REPORT).write_text("A report.\n", encoding="utf-8")
    with contextlib.chdir(top):
        record_jobs(name, read_campaign_folder(folder, ROBOTS).files())
    return folder


def record_jobs(name, files, installed=None):
    """Write the records of the jobs behind a campaign's report, in the working
    directory."""
    tables = [f"results/loop/{name}/{file}" for file in TABLES]
    diagnosis = [f"results/loop/{name}/{file}" for file in DIAGNOSIS]
    reports = [f"reports/loop/{name}/{file}" for file in REPORTS]
    jobs = {
        "read_campaign": (files, tables),
        "diagnose_campaign": (tables[:2], diagnosis),
        "judge_campaign": (tables + diagnosis[:2], reports),
        "compile_loop_report": (
            tables + diagnosis + reports,
            [f"reports/loop/{name}/{REPORT}"],
        ),
    }
    for number, (rule, (inputs, outputs)) in enumerate(jobs.items()):
        digests, code_digests = digest_inputs(
            [*inputs, ENGINE], None if number else [ENGINE]
        )
        times = f"2026-01-01T00:00:0{number}", f"2026-01-01T00:00:0{number + 1}"
        origin = Origin("c0ffee", "d16e57", 1)
        versions = installed or list_versions(".")
        write_records(
            JobRecord(
                rule,
                {"campaign": name},
                *times,
                digests,
                code_digests,
                tuple(outputs),
                origin,
                versions,
            )
        )
