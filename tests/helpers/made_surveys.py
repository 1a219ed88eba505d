"""Small surveys and candidates for tests of planning."""

import numpy as np
from analysed_robots import analysed

from elastocal.application.planning.cell import Cell
from elastocal.application.planning.plan import find_allowed_candidates
from elastocal.application.planning.survey import Survey
from elastocal.campaigns.campaign import Target

OPEN = Cell((), None, 0.1)


def make_survey(name="ur10", measured="position", *, unknown_base=True):
    """Make a survey with one reflector at an unknown offset from the end effector."""
    robot = analysed(name)
    target = Target("T", robot.chain.end_effector.name, None)
    return Survey(
        robot, (target,), unknown_base, measured, 6e-5, 6e-5, 100.0, pulled=True
    )


def make_rows(count=40, numbers=6, parameters=5, seed=1):
    """Draw rows of candidates with different sizes and directions."""
    rng = np.random.default_rng(seed)
    return (
        rng.standard_normal((count, numbers, parameters))
        * rng.uniform(0.1, 3.0, (count, 1, 1))
    ).astype(np.float32)


def make_candidates(survey, count=200, cell=OPEN):
    """Draw configurations that a cell allows."""
    return find_allowed_candidates(survey, cell, count, 1)
