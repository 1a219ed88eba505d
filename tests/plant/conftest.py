"""Robots and campaigns for the plant's tests."""

from dataclasses import replace

import numpy as np
import pytest
from analysed_robots import ROBOTS

from elastocal_proof.plant.arm import read_arm
from elastocal_proof.plant.campaigns import Design, draw_schedule
from elastocal_proof.plant.simulated_robot import draw_specimen
from elastocal_proof.plant.sizing import NoncentralityModel


@pytest.fixture(scope="session", params=["kuka", "fanuc", "abb", "gp180", "iiwa14"])
def name(request):
    """Each robot of the blind proof in turn."""
    return request.param


@pytest.fixture(scope="session")
def arm(name):
    return read_arm(ROBOTS / f"{name}.yaml")


@pytest.fixture(scope="session")
def fanuc_arm():
    return read_arm(ROBOTS / "fanuc.yaml")


@pytest.fixture(scope="session")
def fanuc_specimen(fanuc_arm):
    return draw_specimen(fanuc_arm, 4)


@pytest.fixture(scope="session")
def weightless(fanuc_arm):
    """The same, of an arm that weighs nothing: what only its loads and defects do."""
    return draw_specimen(fanuc_arm, 4, weighs=False)


@pytest.fixture(scope="session")
def small():
    """A short campaign."""
    return Design(poses=8, held_out=2, repeated_poses=3, repeats=2)


@pytest.fixture(scope="session")
def schedule(fanuc_arm, small):
    return draw_schedule(fanuc_arm, small, 2)


@pytest.fixture(scope="session")
def yardstick(fanuc_specimen, schedule):
    # As slow as a campaign of usual length, in which a stand that is knocked is so
    # between two of its poses.
    return NoncentralityModel(
        fanuc_specimen, replace(schedule, time_s=3.0 * schedule.time_s)
    )


@pytest.fixture
def rng():
    return np.random.default_rng(1)
