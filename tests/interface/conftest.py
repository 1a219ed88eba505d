"""A robot whose second joint is off by 2 mrad, measured in a simulation."""

from dataclasses import replace

import numpy as np
import pytest

import elastocal as ec

OFFSET_RAD = 2e-3
NOISE_M = 2e-5


@pytest.fixture(scope="session")
def nominal():
    return ec.read_robot(
        "Tz(0.4) Rz(q1) Tx(0.1) Ry(q2) Tx(0.5) Ry(q3) Tx(0.2) Rx(q4) Tx(0.2) Ry(q5)"
        " Rx(q6) Tx(0.1) Tz(0.05) [tool]",
        name="test arm",
    )


@pytest.fixture(scope="session")
def measured(nominal):
    """Columns of measurements of the faulty robot."""
    limits = np.tile([-2.0, 2.0], (nominal.joints, 1))
    # A robot without springs.
    faulty = replace(nominal, joint_limits=limits, compliance=np.zeros(nominal.joints))
    table = ec.simulate(faulty, poses=40, noise_m=NOISE_M, seed=3)
    # The controller believes that the second joint is where it is not.
    return table.assign(q2=table["q2"] - OFFSET_RAD)


@pytest.fixture(scope="session")
def campaign(nominal, measured):
    target = {"reflector": {"point": "tool", "offset_m": [0, 0, 0], "offset_std_m": 0}}
    return ec.Campaign.from_table(
        nominal, measured, frame="base", declared=[], targets=target, remainder="none"
    )


@pytest.fixture(scope="session")
def result(campaign):
    return ec.diagnose(campaign)
