"""Fixtures: a robot that stands off, a campaign that two mechanisms explain, and the next experiment proposed for it."""

import numpy as np
import pytest
from made_folders import made_folder, made_table
from open_alternatives import ELASTIC, LADDER, SETTINGS, diagnosed, keys_like, limits
from planted import planted, two_loads_a_pose

from elastocal.diagnosis.diagnose import diagnose
from elastocal.diagnosis.next_experiment import propose
from elastocal.diagnosis.settings import Settings
from elastocal.loop.whole import cases_in


@pytest.fixture(scope="session")
def cases(kuka, config_folder, tmp_path_factory):
    """Training and held-out part of a robot whose joint 3 stands 1 mrad beyond what it reports, which is not declared."""
    folder = tmp_path_factory.mktemp("cases") / "made"
    made_folder(folder, kuka, table=made_table(kuka, "made", offset_of_joint_3=1e-3))
    return cases_in(folder, config_folder / "robots")


@pytest.fixture(scope="session")
def diagnosis(cases):
    """Of its training part."""
    return diagnose(cases[0], Settings(), 1)


@pytest.fixture(scope="session")
def ambiguous(kuka):
    """A nonlinear link in eight poses, which the tilt of a joint explains as well."""
    states = two_loads_a_pose(6, 8, (5, 3), 1500.0)
    campaign = planted(kuka, {"link_elasticity@2": (3.9e-8, 5.2e-8)}, seed=3, poses=8, states=states)
    return diagnosed(campaign, kuka, keys_like(campaign, *ELASTIC)), campaign


@pytest.fixture(scope="session")
def proposal(ambiguous, kuka):
    return propose(ambiguous[0], limits(kuka), SETTINGS, np.random.default_rng(0), 10, LADDER)
