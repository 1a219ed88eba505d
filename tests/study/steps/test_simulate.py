"""Experiments in blocks from random streams of their own, and the exact deflections that they cause."""

import numpy as np
import pytest
from made_study_blocks import AT, WRENCH, experiments_of, joined
from scipy.spatial.transform import Rotation
from support import OTHER_CHAINS, PinocchioPoint, robot_of, without_tool

from elastocal.study.steps import blocks
from elastocal.study.steps.columns import to_deflections
from elastocal.study.steps.simulate import ideal_blocks


def test_numbers_of_a_data_set_do_not_depend_on_how_many_there_are_or_how_long_they_are(kuka):
    few, many = joined(experiments_of(kuka, 2, 3)), joined(experiments_of(kuka, 5, 4))
    shared = (many["data_set"] < 2) & (many["configuration"] < 3)
    for name, values in few.items():
        np.testing.assert_array_equal(many[name][shared], values)


@pytest.mark.parametrize(("size", "expected"), [(2, [[0, 1], [2, 3], [4]]), (5, [[0, 1, 2, 3, 4]]), (9, [[0, 1, 2, 3, 4]])])
def test_blocks_are_full_but_for_the_last_and_hold_each_data_set_once(kuka, monkeypatch, size, expected):
    monkeypatch.setattr(blocks, "SETS_PER_BLOCK", size)
    found = experiments_of(kuka, sets=5, configurations=3)
    assert [block["data_set"].tolist() for block in found] == [np.repeat(sets, 3).tolist() for sets in expected]
    assert all(block["configuration"].tolist() == [0, 1, 2] * len(sets) for block, sets in zip(found, expected, strict=True))


@pytest.mark.parametrize("at", AT)
@pytest.mark.parametrize("name", ["three joints", "fixed rotations"])
def test_ideal_deflections_are_the_poses_by_pinocchio_with_the_joints_yielded(name, at):
    robot = robot_of(OTHER_CHAINS[name])
    experiments = experiments_of(robot, sets=2, configurations=2)
    found = list(ideal_blocks(experiments, robot, at))
    assert [block["point"] for block in found] == [point.name for point in robot.chain.points]
    loads = joined(experiments)
    angles = np.column_stack([loads[f"q{j + 1}"] for j in range(robot.joints)])
    wrench = np.column_stack([loads[component] for component in WRENCH])
    for block, point in zip(found, robot.chain.points, strict=True):
        assert block["data_set"].tolist() == [0, 0, 1, 1] and block["configuration"].tolist() == [0, 1, 0, 1]
        seen = PinocchioPoint(robot.chain, point)
        loaded = PinocchioPoint(robot.chain, without_tool(robot.chain.end_effector) if at == "end_effector" else point)
        found = to_deflections(block).reshape(-1, 6)
        for q, force, row in zip(angles, wrench, found, strict=True):
            yielded = q + robot.compliance * (loaded.pose_and_jacobian(q)[2].T @ force)
            (before, turned_before), (after, turned_after) = (seen.pose_and_jacobian(each)[:2] for each in (q, yielded))
            turn = Rotation.from_matrix(turned_after @ turned_before.T).as_rotvec()
            np.testing.assert_allclose(row, [*(after - before), *turn], rtol=0, atol=1e-12)
