"""The FANUC at poses that are repeated: made-up measurements as a MAT file come back as measurements of the chain."""

import numpy as np
import pytest
import scipy.io
from made_fanuc_sources import POSES, REPEATS, assert_holds
from support import refused

from elastocal.campaigns.importers import fanuc_static
from elastocal.campaigns.reading import read_campaign


def test_static_source_becomes_a_campaign_with_repeats(static, config_folder, tmp_path):
    path, angles, positions = static
    fanuc_static.write_campaign(path, tmp_path / "campaign", "fanuc_static")
    campaign = read_campaign(tmp_path / "campaign", config_folder / "robots")
    assert (campaign.name, campaign.measured, campaign.frame) == ("fanuc_static", "position", "tracker")
    assert [(target.name, target.point, target.offset_m) for target in campaign.targets] == [(n, "6DoF", None) for n in "ABC"]
    assert (campaign.compliance, campaign.declared) == ("nominal", ("joint_offset", "link_geometry"))
    assert_holds(campaign.measurements, angles, positions)
    np.testing.assert_array_equal(campaign.measurements.pose, np.arange(POSES).repeat(3 * REPEATS))
    np.testing.assert_array_equal(campaign.measurements.repeat, np.tile(np.arange(REPEATS).repeat(3), POSES))


@pytest.mark.parametrize(
    ("changes", "key", "words"),
    [
        ({"q": None}, "q", ["nothing", "6) numbers"]),
        ({"q": np.zeros((24, 5))}, "q", ["(24, 5)"]),
        ({"q": np.zeros((0, 6))}, "q", ["(0, 6)"]),
        ({"mB": np.zeros((23, 3))}, "mB", ["(23, 3)", "3) numbers"]),
        ({"mC": "text"}, "mC", ["numbers"]),
    ],
)
def test_mat_file_of_other_variables_is_refused(static, tmp_path, changes, key, words):
    contents = {name: value for name, value in scipy.io.loadmat(static[0]).items() if not name.startswith("__")} | changes
    path = tmp_path / "other.mat"
    scipy.io.savemat(path, {name: value for name, value in contents.items() if value is not None})
    with refused(path, key, *words):
        fanuc_static.write_campaign(path, tmp_path / "campaign", "fanuc_static")
    assert not (tmp_path / "campaign").exists()
