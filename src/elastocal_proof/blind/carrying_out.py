"""Experiments after the first, carried out on the robot of a case: the proposed one, and as many random poses beside it.

The plant's side. It gets the name of a case, angles and loads, and makes the robot again from the list of cases; it opens no
sealed file, and what it writes is a campaign like the first.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from elastocal_proof.blind.cases import Case, declared_of, defects_of, design_of, robot_file, specimen_of
from elastocal_proof.blind.folders import write_blind_campaign
from elastocal_proof.blind.follow_up import ARMS, LADDER, POSES, folder_name
from elastocal_proof.plant.campaigns import Design, continued, schedule_of
from elastocal_proof.plant.defects import with_defects
from elastocal_proof.plant.random_numbers import stream

if TYPE_CHECKING:
    import numpy as np

    from elastocal_proof.plant.arm import Arm


def carry_out(case: Case, shown: np.ndarray, wrench: np.ndarray, folder: str | Path, robots_folder: str | Path) -> None:
    """Carry out a proposal and its random counterpart, and write the campaign of the case with what was read further.

    `shown` (E, n): angles as the controller shows them, rad, as in next_experiment.csv; each row another pose, the most
    informative first. `wrench` (E, 6): N, N m; each is read at the shares `LADDER` of it, as the poses of the campaign were.
    `folder`: the campaign with the first of each number of `POSES` goes to ``<arm>_<poses>/<name>/``.
    """
    robot, design = specimen_of(case, robots_folder), design_of(case)
    bad = with_defects(robot, [defect for defect, _ in defects_of(case, robot, design)])
    first = schedule_of(robot.arm, design, case.seed)
    experiments = ((shown, wrench), random_experiment(robot.arm, design, len(wrench), case.seed))
    for arm, (angles, loads) in zip(ARMS, experiments, strict=True):
        for poses in POSES:
            angle = robot.arm.angles_shown_as(angles[:poses])
            schedule = continued(first, angle, loads[:poses], design.seconds_per_state, ladder=LADDER)
            write_blind_campaign(
                Path(folder) / folder_name(arm, poses) / case.name,
                case.name,
                robot_file(case, robots_folder),
                bad,
                design,
                schedule,
                declared_of(case, robot.arm),
            )


def random_experiment(arm: Arm, design: Design, count: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Poses and loads drawn as those of the campaign were.

    `count`: of poses, E. `seed`: of the case. Returns `shown` (E, n); `wrench` (E, 6): the campaign's largest force, in a
    random direction for each pose.
    """
    other = int(stream(seed, "random follow-up").integers(2**48))
    drawn = schedule_of(arm, replace(design, poses=count, held_out=0, ladder=(0.0, 1.0), repeats=1), other)
    loaded = drawn.load == 1
    return arm.shown_angles(drawn.angle[loaded]), drawn.shown_wrench[loaded]
