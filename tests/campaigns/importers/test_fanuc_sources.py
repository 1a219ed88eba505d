"""Both FANUC sources beside each other: each can test the other, and both are one robot."""

import numpy as np

from elastocal.campaigns.importers import fanuc_cpa, fanuc_joint, fanuc_static
from elastocal.campaigns.reading import read_campaign


def test_robot_files_of_the_sources_are_one_robot(fanuc, config_folder, tmp_path, static, cpa):
    fanuc_static.write_campaign(static[0], tmp_path / "a", "fanuc_static")
    fanuc_cpa.write_campaign(cpa[0], tmp_path / "b", "fanuc_cpa")
    fanuc_joint.write_campaign(static[0], cpa[0], tmp_path / "c", config_folder / "robots")
    robots = [read_campaign(tmp_path / name, config_folder / "robots").robot for name in "abc"]
    for robot in robots:
        assert robot.chain == fanuc.chain
        np.testing.assert_array_equal(robot.compliance, fanuc.compliance)
        np.testing.assert_array_equal(robot.joint_limits, robots[0].joint_limits)
