"""The plant's side of the loop once more: proposed experiments, and random ones beside them, on the robots of their cases.

It gets the name of a case, angles and loads, and makes the robot again from the list of cases; it opens no sealed file, and
what it writes is a campaign like the first.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import pandas as pd

from elastocal.mechanics.components import WRENCH_NAMES
from elastocal_proof.blind.cases import Case, cases_of, defects_of, yardstick_of
from elastocal_proof.blind.folders import write_blind_campaign
from elastocal_proof.blind.follow_up import LADDER
from elastocal_proof.blind.verdicts import ARMS, POSES, folder_of
from elastocal_proof.plant.campaigns import Design, continued, schedule_of
from elastocal_proof.plant.defects import with_defects
from elastocal_proof.plant.random_numbers import stream

if TYPE_CHECKING:
    from typing import Any

    import numpy as np

    from elastocal_proof.plant.arm import Arm


def carry_out(case: Case, shown: np.ndarray, wrench: np.ndarray, folder: str | Path, robots_folder: str | Path) -> None:
    """Carry out a proposal and its random counterpart, and write the campaign of the case with what was read further.

    `shown` (E, n): angles as the controller shows them, rad, as in next_experiment.csv; each row another pose, the most
    informative first. `wrench` (E, 6): N, N m; each is read at the shares `LADDER` of it, as the poses of the campaign were.
    `folder`: the campaign with the first of each number of `POSES` goes to `folder_of` it.
    """
    robot, design = case.specimen(robots_folder), case.design
    arm, file = robot.arm, case.robot_file(robots_folder)
    defects = defects_of(case, robot, yardstick_of(case, robot)) if case.effects else []
    bad, first = with_defects(robot, [defect for defect, _ in defects]), schedule_of(arm, design, case.seed)
    for name, (angles, loads) in zip(
        ARMS, ((shown, wrench), random_experiment(arm, design, len(wrench), case.seed)), strict=True
    ):
        for poses in POSES:
            schedule = continued(first, arm.angles_shown_as(angles[:poses]), loads[:poses], LADDER)
            to = folder_of(folder, name, poses, case.name)
            write_blind_campaign(to, case.name, file, bad, design, schedule, case.declared(arm))


def random_experiment(arm: Arm, design: Design, count: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Poses and loads drawn as those of the campaign were.

    Returns angles (E, n) as shown, and wrenches (E, 6): the campaign's largest force, in a random direction for each pose.
    """
    other = int(stream(seed, "random follow-up").integers(2**48))
    drawn = schedule_of(arm, replace(design, poses=count, held_out=0, ladder=(0.0, 1.0), repeats=1), other)
    loaded = drawn.load == 1
    return arm.shown_angles(drawn.angle[loaded]), drawn.shown_wrench[loaded]


def carry_out_follow_ups(job: Any) -> None:
    """Proposed experiments, and random ones beside them, on the robots of their cases."""
    Path(job.output.campaigns).mkdir(parents=True, exist_ok=True)
    plan, robots = job.params.plan, Path(job.input.robots[0]).parent
    cases = {case.name: case for case in cases_of(plan, job.params.size, job.params.seed)}
    for name, states in pd.read_csv(job.input.proposals).groupby("case"):
        # A block has arms of six joints and of seven.
        shown = states.filter(regex=r"^q\d+$").dropna(axis=1).to_numpy()
        carry_out(cases[str(name)], shown, states[list(WRENCH_NAMES)].to_numpy(), job.output.campaigns, robots)
