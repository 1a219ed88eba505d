"""Both FANUC sources beside each other: each can test the other, and both are one robot."""

import numpy as np

from elastocal.campaigns.holdout import split
from elastocal.campaigns.importers import fanuc_cpa, fanuc_joint, fanuc_static
from elastocal.campaigns.reading import held_out_campaign, read_campaign


def test_each_session_can_test_the_other(static, cpa, config_folder, tmp_path):
    robots = config_folder / "robots"
    fanuc_static.write_campaign(static[0], tmp_path / "static", "static_to_cpa", {"campaign": "../cpa"})
    fanuc_cpa.write_campaign(cpa[0], tmp_path / "cpa", "cpa_to_static", {"campaign": "../static"})
    for here, there in (("static", "cpa"), ("cpa", "static")):
        campaign = read_campaign(tmp_path / here, robots)
        training, held_out = split(campaign)
        assert len(training) == len(campaign.measurements) and len(held_out) == 0
        assert held_out_campaign(campaign, tmp_path / here, robots).name == f"{there}_to_{here}"


def test_robot_files_of_the_sources_are_one_robot(fanuc, config_folder, tmp_path, static, cpa):
    fanuc_static.write_campaign(static[0], tmp_path / "a")
    fanuc_cpa.write_campaign(cpa[0], tmp_path / "b")
    fanuc_joint.write_campaign(static[0], cpa[0], tmp_path / "c", config_folder / "robots")
    robots = [read_campaign(tmp_path / name, config_folder / "robots").robot for name in "abc"]
    for robot in robots:
        assert robot.chain == fanuc.chain
        np.testing.assert_array_equal(robot.compliance, fanuc.compliance)
        np.testing.assert_array_equal(robot.joint_limits, robots[0].joint_limits)
