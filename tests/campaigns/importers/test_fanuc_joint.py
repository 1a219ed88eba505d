"""Both sessions of the FANUC as one campaign of one robot."""

import numpy as np
from made_fanuc_sources import POSES, REPEATS, assert_holds

from elastocal.campaigns.importers import fanuc_joint
from elastocal.campaigns.reading import read_campaign


def test_joint_campaign_holds_both_as_sessions_of_one_robot(static, cpa, config_folder, tmp_path):
    fanuc_joint.write_campaign(static[0], cpa[0], tmp_path / "campaign", config_folder / "robots")
    campaign = read_campaign(tmp_path / "campaign", config_folder / "robots")
    for session, (_, angles, positions) in enumerate((static, cpa)):
        measurements = campaign.measurements.select(campaign.measurements.session == session)
        assert_holds(measurements, angles, positions)
        assert {campaign.targets[index].name for index in measurements.target} == set(("ABC", "DEF")[session])


def test_poses_and_repeats_are_counted_session_by_session(static, cpa, config_folder, tmp_path):
    fanuc_joint.write_campaign(static[0], cpa[0], tmp_path / "campaign", config_folder / "robots")
    measurements = read_campaign(tmp_path / "campaign", config_folder / "robots").measurements
    poses = [np.arange(POSES).repeat(3 * REPEATS), np.arange(POSES).repeat(3)]
    assert measurements.session.tolist() == [0] * len(poses[0]) + [1] * len(poses[1])
    np.testing.assert_array_equal(measurements.pose, np.concatenate(poses))
    assert measurements.repeat.max() == REPEATS - 1 and not measurements.repeat[measurements.session == 1].any()
