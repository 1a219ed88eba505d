"""Simulated campaigns: without noise they are the elastostatics of the study, with noise they are as planned."""

import numpy as np
from scipy.spatial.transform import Rotation

from elastocal.campaigns.simulation import Plan, draw_measurements
from elastocal.mechanics.components import WRENCH_NAMES
from elastocal.mechanics.elastostatics import exact_deflections, generalized_forces
from elastocal.mechanics.kinematics import poses, poses_and_jacobians

POINTS = ("3DoF", "6DoF")
PLAN = Plan(POINTS, 10, 800.0, (0, 1, -0.5), (0.0, 0.5, 0.1), 3, 2, 0.0, 0.0)


def angles_of(table, robot):
    return np.column_stack([table[f"q{joint + 1}"] for joint in range(robot.joints)])


def select(table, point):
    mask = table["target"] == point
    return {name: values[mask] for name, values in table.items()}


def test_without_noise_it_is_the_elastostatics_of_the_reduced_robot(robot):
    table = draw_measurements(robot, PLAN, 1, "exact")
    for point in POINTS:
        part = select(table, point)
        angles, wrench = angles_of(part, robot), np.column_stack([part[name] for name in WRENCH_NAMES])
        place = robot.chain.point(point)
        end = poses_and_jacobians(robot.chain, angles, robot.chain.end_effector)[2]
        turned = generalized_forces(end, wrench) * robot.compliance
        expected = exact_deflections(robot.chain, angles, turned, place)
        position, rotation = poses(robot.chain, angles, place)
        measured = np.column_stack([part[axis] for axis in "xyz"])
        np.testing.assert_allclose(measured - position, expected[:, :3], atol=1e-12)
        read = Rotation.from_rotvec(np.column_stack([part[name] for name in ("rx", "ry", "rz")]))
        turn = (read * Rotation.from_matrix(rotation).inv()).as_rotvec()
        np.testing.assert_allclose(turn, expected[:, 3:], atol=1e-7)
        assert (np.linalg.norm(expected[:, :3], axis=1) > 1e-6).sum() == (part["load"] > 0).sum()


def test_the_plan_is_kept(kuka):
    table = select(draw_measurements(kuka, PLAN, 3, "plan"), "6DoF")
    visits = list(zip(table["pose"], table["load"], table["repeat"], strict=True))
    assert len(set(visits)) == len(visits) == 2 * (3 + 3 + 1) + 8 * 3
    assert {visit for visit in visits if visit[0] == 1} == {*((1, load, r) for load in (0, 1) for r in range(3)), (1, 2, 0)}
    force = np.column_stack([table[name] for name in WRENCH_NAMES[:3]])
    moment = np.column_stack([table[name] for name in WRENCH_NAMES[3:]])
    np.testing.assert_allclose(moment, np.cross(PLAN.offset_m, force), atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(force, axis=1), 800 * np.abs(np.array(PLAN.ladder)[table["load"]]))
    angles = angles_of(table, kuka)
    low, high = kuka.joint_limits.T
    assert ((angles >= low) & (angles <= high)).all()
    for pose in range(PLAN.poses):
        assert len(np.unique(angles[table["pose"] == pose], axis=0)) == 1
