"""Small surveys and candidates to plan with."""

import numpy as np
from analysed_robots import analysed

from elastocal.application.planning.cell import Cell
from elastocal.application.planning.plan import find_allowed_candidates
from elastocal.application.planning.survey import Survey
from elastocal.campaigns.campaign import Target

OPEN = Cell((), None, 0.1)


def make_survey(name="ur10", measured="position", unknown_base=True):
    """One reflector at an unknown place of the end effector."""
    robot = analysed(name)
    target = Target("T", robot.chain.end_effector.name, None)
    return Survey(
        robot, (target,), unknown_base, measured, 6e-5, 6e-5, 100.0, pulled=True
    )


def make_rows(count=40, numbers=6, parameters=5, seed=1):
    """Rows of candidates of unlike size and direction."""
    draws = np.random.default_rng(seed)
    return (
        draws.standard_normal((count, numbers, parameters))
        * draws.uniform(0.1, 3.0, (count, 1, 1))
    ).astype(np.float32)


def make_candidates(survey, count=200, cell=OPEN):
    """Configurations that a cell allows."""
    return find_allowed_candidates(survey, cell, count, 1)
