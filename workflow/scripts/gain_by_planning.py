"""A plan against random poses on one robot."""

from pathlib import Path

from job import Job, run

from elastocal.application.inverse_kinematics import reach_m
from elastocal.application.planning.cell import RADIUS_SHARE, Cell
from elastocal.application.planning.gains import gains
from elastocal.application.planning.plan import Loads
from elastocal.application.planning.survey import Survey
from elastocal.campaigns.campaign import Target
from elastocal.campaigns.reading import read_robot
from elastocal.io.json_files import write_json


def gain_by_planning(job: Job) -> None:
    robot, plan = read_robot(Path(job.input.robot)), job.params.plan
    loads = Loads(plan["force_N"], True)
    end = robot.chain.end_effector.name
    survey = Survey(robot, (Target(end, end, None),), True, "position", loads.shares, plan["noise_m"], plan["noise_m"])
    cell = Cell((), None, RADIUS_SHARE * reach_m(robot))
    write_json(job.output.gains, gains(survey, cell, loads, plan["poses"], plan["candidates"], job.params.seed))


run(gain_by_planning, snakemake)
