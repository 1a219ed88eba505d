"""The kind `relative` is a pose whose frame is that of the first pose."""

from elastocal.measuring.pose import POSE
from elastocal.measuring.relative import RELATIVE


def test_a_relative_pose_is_read_as_a_pose():
    assert RELATIVE.columns == POSE.columns
    assert RELATIVE.reads_poses
