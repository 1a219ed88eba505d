"""Simulate a campaign of a robot that has an effect which its declared model lacks."""

from pathlib import Path

from job import Job, run

from elastocal.campaigns.simulation import Plan, draw_measurements
from elastocal.campaigns.writing import write_campaign
from elastocal.mechanics.robot_file import parse_robot


def simulate_campaign(job: Job) -> None:
    settings = job.params.source
    name = job.wildcards.campaign
    robot = parse_robot(settings["robot_document"], settings["robot"])
    plan_settings = {
        key: tuple(value) if isinstance(value, list) else value
        for key, value in settings.items()
        if key in Plan.__annotations__
    }
    plan = Plan(**plan_settings)
    document = {
        "campaign": name,
        "robot": settings["declared_robot"],
        "measured": "pose",
        "frame": "base",
        "targets": {
            point: {"point": point, "offset_m": [0, 0, 0], "offset_std_m": 0}
            for point in settings["points"]
        },
        "compliance": "identify",
        "application_point_std_m": 0,
        "declared": [],
        "holdout": {"fraction": 0.3, "seed": 1},
    }
    table = draw_measurements(robot, plan, job.params.seed, name)
    write_campaign(Path(job.output.document).parent, document, table, robot.joints)


run(simulate_campaign, snakemake)
