"""UR5 and WAM as campaigns: made-up measurements in the files' own format come back as measurements of the chain."""

import numpy as np
import pytest
from support import refused

from elastocal.campaigns.importers import jacobi
from elastocal.campaigns.reading import read_campaign, read_robot

POSES = 9


class File:
    """A file of the source that a test spoils before it imports it."""

    def __init__(self, folder, joints=6, seed=1):
        rng = np.random.default_rng(seed)
        self.path, self.folder = folder / f"grid{seed}.csv", folder / f"campaign{seed}"
        self.degrees = rng.uniform(-49, 70, (POSES, joints))
        self.commanded_mm = rng.uniform(-600, 600, (POSES, 3))
        self.measured_mm = (self.commanded_mm + rng.normal(0, 2, (POSES, 3))).round(6)
        self.columns = {"step_order": list(range(POSES))}
        self.columns |= {f"{axis}_t": self.commanded_mm[:, i] for i, axis in enumerate("xyz")}
        self.columns |= {f"{axis}_dif": (self.measured_mm - self.commanded_mm)[:, i] for i, axis in enumerate("xyz")}
        self.columns |= {f"joint_{j + 1}": self.degrees[:, j] for j in range(joints)}

    def write(self):
        rows = zip(*self.columns.values(), strict=True)
        lines = [",".join(self.columns), *(",".join(map(str, row)) for row in rows)]
        self.path.write_text("\n".join(lines) + "\n", encoding="utf-8")

    def write_campaign(self, name, holdout=None):
        self.write()
        jacobi.write_campaign(self.path, self.folder, name, holdout)


@pytest.fixture
def file(tmp_path):
    return File(tmp_path)


@pytest.mark.parametrize(("joints", "robot"), [(6, "ur5"), (7, "wam")])
def test_file_becomes_a_campaign_of_measured_positions(tmp_path, config_folder, joints, robot):
    file = File(tmp_path, joints)
    file.write_campaign("grid")
    campaign = read_campaign(file.folder, config_folder / "robots")
    expected = read_robot(config_folder / "robots" / f"{robot}.yaml")
    assert (campaign.measured, campaign.frame, campaign.noise) == ("position", "tracker", jacobi.NOISE)
    assert campaign.robot.name == expected.name
    assert [(target.point, target.offset_m) for target in campaign.targets] == [(f"{joints}DoF", None)]
    np.testing.assert_allclose(campaign.measurements.joint_angles, np.radians(file.degrees), rtol=0, atol=1e-12)
    np.testing.assert_allclose(campaign.measurements.position, 1e-3 * file.measured_mm, rtol=0, atol=1e-12)
    np.testing.assert_array_equal(campaign.measurements.wrench, 0)
    np.testing.assert_array_equal(campaign.measurements.pose, np.arange(POSES))


@pytest.mark.parametrize("name", ["x_t", "z_dif"])
def test_missing_column_is_refused(file, name):
    del file.columns[name]
    file.write()
    with refused(file.path, "header", f"no column {name!r}"):
        jacobi.read(file.path)


@pytest.mark.parametrize("joints", [0, 5, 8])
def test_another_number_of_joints_is_refused(tmp_path, joints):
    file = File(tmp_path, joints)
    file.write()
    with refused(file.path, "header", "joint_1 to joint_6 or joint_7"):
        jacobi.read(file.path)
