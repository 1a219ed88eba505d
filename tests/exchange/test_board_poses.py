"""Poses of a board become measurements of a campaign, and poses that no camera measures
are refused."""

from dataclasses import replace

import numpy as np
import pytest
from made_boards import make_board_poses, stack_matrices
from scipy.spatial.transform import Rotation
from support import refused

from elastocal.exchange.board_poses import (
    BoardPoses,
    check_poses,
    describe_board_campaign,
    tabulate_board_poses,
)
from elastocal.io.documents import check_document
from elastocal.measuring.board import BESIDE_ROBOT, ON_ROBOT

ANGLES, ROTATION, POSITION = make_board_poses()
POSES = BoardPoses("poses.yaml", POSITION, ROTATION, ANGLES)


def read_poses(table):
    """Return the measured poses of a table as homogeneous matrices."""
    vectors = np.column_stack([table[name] for name in ("rx", "ry", "rz")])
    position = np.column_stack([table[name] for name in "xyz"])
    return stack_matrices(Rotation.from_rotvec(vectors).as_matrix(), position)


@pytest.mark.parametrize(
    ("camera", "target"), [(ON_ROBOT, "camera"), (BESIDE_ROBOT, "board")]
)
def test_a_row_has_the_pose_of_the_board_and_the_target_is_on_the_robot(camera, target):
    table = tabulate_board_poses(POSES, camera)
    np.testing.assert_allclose(
        read_poses(table), stack_matrices(ROTATION, POSITION), atol=1e-12
    )
    np.testing.assert_array_equal(table["q3"], ANGLES[:, 2])
    assert set(table["target"]) == {target}


@pytest.mark.parametrize("camera", [ON_ROBOT, BESIDE_ROBOT])
def test_the_document_is_a_valid_campaign_of_the_tables_target(camera):
    document = describe_board_campaign("mine", "7DoF", camera)
    check_document(document, "campaign", "campaign.yaml")
    assert {*document["targets"]} == {*tabulate_board_poses(POSES, camera)["target"]}


def test_poses_without_joint_angles_are_refused():
    with refused("poses.yaml", "", "no joint angles", "--joints FILE"):
        tabulate_board_poses(replace(POSES, angles=None), ON_ROBOT)


def change(array, value):
    changed = np.array(array)
    changed[4] = value
    return changed


@pytest.mark.parametrize(
    ("changes", "phrases"),
    [
        ({"rotation": change(ROTATION, np.diag([1, 1, -1]))}, ["mirrored", "-1"]),
        (
            {"rotation": change(ROTATION, 0.9 * np.eye(3))},
            ["no rotation", "row by row"],
        ),
        ({"position": change(POSITION, [0, 0, 500])}, ["20 m", "--lengths mm"]),
        ({"position": change(POSITION, np.nan)}, ["no number"]),
    ],
)
def test_a_pose_that_no_camera_measures_is_refused_by_its_sample(changes, phrases):
    check_poses(POSES)
    with refused("poses.yaml", "sample 5", *phrases):
        check_poses(replace(POSES, **changes))
