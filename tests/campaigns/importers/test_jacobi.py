"""UR5 and WAM as campaigns: made-up measurements in the files' own format come back as measurements of the chain."""

import numpy as np
import pytest
from support import homogeneous, refused

from elastocal.campaigns.importers import jacobi
from elastocal.campaigns.reading import held_out_campaign, read_campaign, read_robot
from elastocal.mechanics.kinematics import poses

POSES = 9
UR5 = [  # d, a, alpha of the maker
    (0.089159, 0.0, 90.0),
    (0.0, -0.425, 0.0),
    (0.0, -0.39225, 0.0),
    (0.10915, 0.0, 90.0),
    (0.09465, 0.0, -90.0),
    (0.0823, 0.0, 0.0),
]
WAM = [
    (0.0, 0.0, -90.0),
    (0.0, 0.0, 90.0),
    (0.55, 0.045, -90.0),
    (0.0, -0.045, 90.0),
    (0.3, 0.0, -90.0),
    (0.0, 0.0, 90.0),
    (0.06, 0.0, 0.0),
]
ROBOTS = {"ur5": UR5, "wam": WAM}


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


def test_rows_keep_the_order_in_which_they_were_measured(file, config_folder):
    file.write_campaign("grid")
    measurements = read_campaign(file.folder, config_folder / "robots").measurements
    assert (np.diff(measurements.row) > 0).all()


def test_random_poses_test_the_grid(tmp_path, config_folder):
    for seed, name in ((1, "grid"), (2, "random")):
        File(tmp_path, seed=seed).write_campaign(name, {"campaign": f"../campaign{3 - seed}"})
    robots = config_folder / "robots"
    campaign = read_campaign(tmp_path / "campaign1", robots)
    assert held_out_campaign(campaign, tmp_path / "campaign1", robots).name == "random"


@pytest.mark.parametrize("robot", ROBOTS)
def test_chain_is_the_makers_denavit_hartenberg(config_folder, robot):
    chain = read_robot(config_folder / "robots" / f"{robot}.yaml").chain
    for angles in np.random.default_rng(7).uniform(-np.pi, np.pi, (5, len(ROBOTS[robot]))):
        expected = np.eye(4)
        for angle, (d, a, alpha) in zip(angles, ROBOTS[robot], strict=True):
            expected = expected @ homogeneous("R", 2, angle) @ homogeneous("T", 2, d)
            expected = expected @ homogeneous("T", 0, a) @ homogeneous("R", 0, np.radians(alpha))
        position, rotation = poses(chain, angles[None], chain.end_effector)
        np.testing.assert_allclose(position[0], expected[:3, 3], rtol=0, atol=1e-14)
        np.testing.assert_allclose(rotation[0], expected[:3, :3], rtol=0, atol=1e-14)


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


def test_joints_that_are_not_counted_from_one_are_refused(file):
    file.columns["joint_7"] = file.columns.pop("joint_1")
    file.write()
    with refused(file.path, "header", "joint_7"):
        jacobi.read(file.path)


@pytest.mark.parametrize("cell", ["", "1.5.2", "inf", "none"])
def test_cell_that_is_no_number_is_refused(file, cell):
    file.columns["y_dif"] = [cell if row == 3 else 1.5 for row in range(POSES)]
    file.write()
    with refused(file.path, "row 4, column y_dif", repr(cell), "a number"):
        jacobi.read(file.path)


def test_missing_file_is_refused(file):
    with refused(file.path, "", "readable file"):
        jacobi.read(file.path)
