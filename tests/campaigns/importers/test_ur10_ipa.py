"""The UR10 series as campaigns: made-up measurements in the files' own format come back as measurements of the chain."""

import numpy as np
import pytest
from support import refused

from elastocal.campaigns.importers import ur10_ipa
from elastocal.campaigns.reading import read_campaign

POSES = 9


class Series:
    """A file of the source that a test spoils before it imports it."""

    def __init__(self, folder):
        rng = np.random.default_rng(6)
        self.path, self.folder = folder / "series.csv", folder / "campaign"
        self.angles = rng.uniform(-3, 3, (POSES, 6)).round(9)
        # Poses 2 and 5 are approached again, as near as the controller comes.
        self.angles = np.vstack([self.angles, self.angles[[2, 5]] + 4e-5])
        count = len(self.angles)
        self.position_mm, self.degrees = (
            rng.uniform(-3000, 3000, (count, 3)).round(5),
            rng.uniform(-89, 89, (count, 3)).round(6),
        )
        self.columns = {"Timestamp": [f"2020071416{39 + i // 6}{10 * (i % 6):02d}" for i in range(count)]}
        self.columns |= {f"Goal {name}": np.zeros(count) for name in ("x", "y", "z", "roll", "pitch", "yaw")}
        self.columns |= dict(zip(ur10_ipa.ANGLES, self.angles.T, strict=True))
        self.columns["measurement_temperature"] = 20 + 0.25 * np.arange(count)
        self.columns |= dict(zip(ur10_ipa.POSITION, self.position_mm.T, strict=True))
        self.columns["measurement_std_x"] = np.ones(count)
        self.columns |= dict(zip(ur10_ipa.ORIENTATION, self.degrees.T, strict=True))

    def write(self):
        cells = [[name, *(str(cell).replace(".", ",") for cell in column)] for name, column in self.columns.items()]
        self.path.write_text("".join(";".join(row) + "\r\n" for row in zip(*cells, strict=True)), encoding="utf-8")

    def campaign(self, config_folder):
        self.write()
        ur10_ipa.write_campaign(self.path, self.folder, "series")
        return read_campaign(self.folder, config_folder / "robots")


@pytest.fixture
def series(tmp_path):
    return Series(tmp_path)


def test_series_becomes_a_campaign_of_poses(series, config_folder):
    campaign = series.campaign(config_folder)
    measurements = campaign.measurements
    assert (campaign.name, campaign.measured, campaign.frame, campaign.noise) == ("series", "pose", "tracker", ur10_ipa.NOISE)
    assert [(target.point, target.offset_m) for target in campaign.targets] == [("6DoF", None)]
    np.testing.assert_allclose(measurements.joint_angles, series.angles, rtol=0, atol=1e-15)
    np.testing.assert_allclose(measurements.position, 1e-3 * series.position_mm, rtol=0, atol=1e-15)
    np.testing.assert_array_equal(measurements.temperature_c, 20 + 0.25 * np.arange(len(measurements)))
    np.testing.assert_array_equal(measurements.time_s, 10.0 * np.arange(len(measurements)))
    np.testing.assert_array_equal(measurements.wrench, 0)


def test_the_same_joint_angles_again_are_repeats_of_their_pose(series, config_folder):
    measurements = series.campaign(config_folder).measurements
    assert measurements.pose.tolist() == [*range(POSES), 2, 5]
    assert measurements.repeat.tolist() == POSES * [0] + [1, 1]


def test_stamps_that_a_spreadsheet_cut_down_leave_time_out(series, config_folder):
    series.columns["Timestamp"] = len(series.angles) * ["2,02011E+13"]
    assert series.campaign(config_folder).measurements.time_s is None


@pytest.mark.parametrize("name", ["elbow_joint", "measurement_y", "measurement_rz"])
def test_missing_column_is_refused(series, name):
    del series.columns[name]
    series.write()
    with refused(series.path, "header", f"no column {name!r}"):
        ur10_ipa.read(series.path)
