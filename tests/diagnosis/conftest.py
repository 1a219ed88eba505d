"""Fixtures: a robot with a wrong zero of one joint, and its diagnosis."""

import pytest
from made_folders import make_folder, make_table

from elastocal.diagnosis.diagnose import diagnose
from elastocal.diagnosis.settings import Settings
from elastocal.loop.whole import read_cases


@pytest.fixture(scope="session")
def cases(kuka, config_folder, tmp_path_factory):
    """Training and held-out case of a robot whose joint 3 stands 1 mrad beyond the
    angle that it reports, which is not declared."""
    folder = tmp_path_factory.mktemp("cases") / "made"
    make_folder(folder, kuka, table=make_table(kuka, "made", offset_of_joint_3=1e-3))
    return read_cases(folder, config_folder / "robots")


@pytest.fixture(scope="session")
def diagnosis(cases):
    """Diagnosis of the training case."""
    return diagnose(cases[0], Settings(), 1)
