"""Simulated campaigns: without noise they are the elastostatics of the study, at states
as planned."""

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from elastocal.campaigns.simulation import Plan, draw_measurements
from elastocal.mechanics.components import WRENCH_NAMES
from elastocal.mechanics.elastostatics import (
    compute_exact_deflections,
    compute_generalized_forces,
)
from elastocal.mechanics.kinematics import compute_poses, compute_poses_and_jacobians

PLAN = Plan(("3DoF", "6DoF"), 10, 800.0, (0, 1, -0.5), (0.0, 0.5, 0.1), 3, 2, 0.0, 0.0)


def test_without_noise_it_is_the_elastostatics_of_the_reduced_robot_at_states_as_planned(
    robot,
):
    table = draw_measurements(robot, PLAN, 1, "exact")
    for point in PLAN.points:
        part = {
            name: values[table["target"] == point] for name, values in table.items()
        }
        angles, wrench, place, read = (
            np.column_stack([part[name] for name in names])
            for names in (
                [f"q{j + 1}" for j in range(robot.joints)],
                WRENCH_NAMES,
                "xyz",
                ("rx", "ry", "rz"),
            )
        )
        at = robot.chain.point(point)
        end = compute_poses_and_jacobians(
            robot.chain, angles, robot.chain.end_effector
        )[2]
        expected = compute_exact_deflections(
            robot.chain,
            angles,
            compute_generalized_forces(end, wrench) * robot.compliance,
            at,
        )
        position, rotation = compute_poses(robot.chain, angles, at)
        np.testing.assert_allclose(place - position, expected[:, :3], atol=1e-12)
        turn = (
            Rotation.from_rotvec(read) * Rotation.from_matrix(rotation).inv()
        ).as_rotvec()
        np.testing.assert_allclose(turn, expected[:, 3:], atol=1e-7)
        assert (np.linalg.norm(expected[:, :3], axis=1) > 1e-6).sum() == (
            part["load"] > 0
        ).sum()
        visits = list(zip(part["pose"], part["load"], part["repeat"], strict=True))
        assert len(set(visits)) == len(visits) == 2 * (3 + 3 + 1) + 8 * 3
        assert {each for each in visits if each[0] == 1} == {
            *((1, load, r) for load in (0, 1) for r in range(3)),
            (1, 2, 0),
        }
        np.testing.assert_allclose(
            wrench[:, 3:], np.cross(PLAN.offset_m, wrench[:, :3]), atol=1e-9
        )
        np.testing.assert_allclose(
            np.linalg.norm(wrench[:, :3], axis=1),
            800 * np.abs(np.array(PLAN.ladder)[part["load"]]),
        )
        low, high = robot.joint_limits.T
        assert ((angles >= low) & (angles <= high)).all()
        assert (
            len(np.unique(angles, axis=0))
            == PLAN.poses
            == len(np.unique(np.column_stack([part["pose"], angles]), axis=0))
        )


def test_noise_has_its_size_in_positions_and_in_orientations(robot):
    exact, moved, turned = (
        draw_measurements(
            robot, replace(PLAN, noise_m=noise_m, noise_rad=noise_rad), 1, "exact"
        )
        for noise_m, noise_rad in ((0.0, 0.0), (1e-3, 0.0), (0.0, 1e-3))
    )
    for table, names, others in (
        (moved, "xyz", ("rx", "ry", "rz")),
        (turned, ("rx", "ry", "rz"), "xyz"),
    ):
        off = np.array([table[name] - exact[name] for name in names])
        assert 0.5e-3 < np.sqrt((np.sort(off**2, axis=1)[:, :-10]).mean()) < 2e-3
        assert all((table[name] == exact[name]).all() for name in others)
