"""Robots and campaigns for the tests of the simulated robot."""

from dataclasses import replace

import numpy as np
import pytest
from analysed_robots import ROBOTS

from elastocal_proof.plant.arm import read_arm
from elastocal_proof.plant.campaigns import Design, draw_schedule
from elastocal_proof.plant.simulated_robot import draw_specimen
from elastocal_proof.plant.sizing import NoncentralityModel


@pytest.fixture(scope="session", params=["kuka", "fanuc", "abb", "gp180", "iiwa14"])
def robot_name(request):
    """Each robot of the blind benchmark in turn."""
    return request.param


@pytest.fixture(scope="session")
def arm(robot_name):
    return read_arm(ROBOTS / f"{robot_name}.yaml")


@pytest.fixture(scope="session")
def fanuc_arm():
    return read_arm(ROBOTS / "fanuc.yaml")


@pytest.fixture(scope="session")
def fanuc_specimen(fanuc_arm):
    return draw_specimen(fanuc_arm, 4)


@pytest.fixture(scope="session")
def weightless_specimen(fanuc_arm):
    """The same specimen without weight, so that only loads and defects deflect it."""
    return draw_specimen(fanuc_arm, 4, weighs=False)


@pytest.fixture(scope="session")
def short_design():
    """Design of a short campaign."""
    return Design(poses=8, held_out=2, repeated_poses=3, repeats=2)


@pytest.fixture(scope="session")
def schedule(fanuc_arm, short_design):
    return draw_schedule(fanuc_arm, short_design, 2)


@pytest.fixture(scope="session")
def noncentrality(fanuc_specimen, schedule):
    # The campaign takes as long as a usual one, so that a knock of the stand falls
    # between two of its poses.
    slow_schedule = replace(schedule, time_s=3.0 * schedule.time_s)
    return NoncentralityModel(fanuc_specimen, slow_schedule)


@pytest.fixture
def rng():
    return np.random.default_rng(1)
