"""The plant's tests need MuJoCo, which is not among the pins of the other tests."""

import numpy as np
import pytest

pytest.importorskip("mujoco", reason="the plant needs the extra `blind`")

from analysed_robots import ROBOTS

from elastocal.plant.arm import arm_from_file
from elastocal.plant.campaigns import Design, schedule_of
from elastocal.plant.physical_robot import PhysicalRobot, specimen


@pytest.fixture(scope="session", params=["kuka", "fanuc", "abb"])
def name(request):
    """Each robot of the blind proof in turn."""
    return request.param


@pytest.fixture(scope="session")
def arm(name):
    return arm_from_file(ROBOTS / f"{name}.yaml")


@pytest.fixture(scope="session")
def fanuc_arm():
    return arm_from_file(ROBOTS / "fanuc.yaml")


@pytest.fixture(scope="session")
def faultless(fanuc_arm):
    """A FANUC with the compliances of its file and a sharp-eyed tracker."""
    return PhysicalRobot(fanuc_arm, fanuc_arm.compliance)


@pytest.fixture(scope="session")
def fanuc_specimen(fanuc_arm):
    return specimen(fanuc_arm, 4)


@pytest.fixture(scope="session")
def small():
    """A short campaign."""
    return Design(poses=8, held_out=2, repeated_poses=3, repeats=2)


@pytest.fixture(scope="session")
def schedule(fanuc_arm, small):
    return schedule_of(fanuc_arm, small, 2)


@pytest.fixture
def rng():
    return np.random.default_rng(1)
