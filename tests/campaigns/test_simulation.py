"""Simulated campaigns follow the elastostatics of the study at the planned states, and
have noise of the planned size."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from elastocal.campaigns.simulation import Plan, draw_measurements
from elastocal.mechanics.components import WRENCH_NAMES
from elastocal.mechanics.elastostatics import (
    compute_exact_deflections,
    compute_generalized_forces,
)
from elastocal.mechanics.kinematics import compute_poses, compute_poses_and_jacobians

PLAN = Plan(("3DoF", "6DoF"), 10, 800.0, (0, 1, -0.5), (0.0, 0.5, 0.1), 3, 2, 0.0, 0.0)


@pytest.fixture(scope="module")
def exact_table(robot):
    """Measurements without noise, as columns."""
    return draw_measurements(robot, PLAN, 1, "exact")


def select_point(table, point):
    """Return the rows of a table that measure one point."""
    of_point = table["target"] == point
    return {name: values[of_point] for name, values in table.items()}


def stack_columns(table, names):
    """Return columns of a table as an array, one row a measurement."""
    return np.column_stack([table[name] for name in names])


def get_joint_angles(table, robot):
    """Return the joint angles of a table, (M, joints)."""
    return stack_columns(table, [f"q{joint + 1}" for joint in range(robot.joints)])


@pytest.mark.parametrize("name", PLAN.points)
def test_without_noise_measurements_are_the_elastostatics_of_the_reduced_robot(
    robot, exact_table, name
):
    table = select_point(exact_table, name)
    chain = robot.chain
    point = chain.point(name)
    angles = get_joint_angles(table, robot)
    wrench = stack_columns(table, WRENCH_NAMES)
    jacobian = compute_poses_and_jacobians(chain, angles, chain.end_effector)[2]
    deflection = compute_exact_deflections(
        chain,
        angles,
        compute_generalized_forces(jacobian, wrench) * robot.compliance,
        point,
    )
    position, rotation = compute_poses(chain, angles, point)
    np.testing.assert_allclose(
        stack_columns(table, "xyz") - position, deflection[:, :3], atol=1e-12
    )
    measured = Rotation.from_rotvec(stack_columns(table, ("rx", "ry", "rz")))
    difference = measured * Rotation.from_matrix(rotation).inv()
    np.testing.assert_allclose(difference.as_rotvec(), deflection[:, 3:], atol=1e-7)
    is_deflected = np.linalg.norm(deflection[:, :3], axis=1) > 1e-6
    assert is_deflected.sum() == (table["load"] > 0).sum()


@pytest.mark.parametrize("name", PLAN.points)
def test_poses_loads_and_repeats_are_measured_as_planned(robot, exact_table, name):
    table = select_point(exact_table, name)
    visits = list(zip(table["pose"], table["load"], table["repeat"], strict=True))
    assert len(set(visits)) == len(visits) == 2 * (3 + 3 + 1) + 8 * 3
    assert {visit for visit in visits if visit[0] == 1} == {
        *((1, load, repeat) for load in (0, 1) for repeat in range(3)),
        (1, 2, 0),
    }
    wrench = stack_columns(table, WRENCH_NAMES)
    np.testing.assert_allclose(
        wrench[:, 3:], np.cross(PLAN.offset_m, wrench[:, :3]), atol=1e-9
    )
    np.testing.assert_allclose(
        np.linalg.norm(wrench[:, :3], axis=1),
        800 * np.abs(np.array(PLAN.ladder)[table["load"]]),
    )
    angles = get_joint_angles(table, robot)
    low, high = robot.joint_limits.T
    assert ((angles >= low) & (angles <= high)).all()
    assert len(np.unique(angles, axis=0)) == PLAN.poses
    angles_of_poses = np.column_stack([table["pose"], angles])
    assert len(np.unique(angles_of_poses, axis=0)) == PLAN.poses


POSITION = ("x", "y", "z")
ROTATION_VECTOR = ("rx", "ry", "rz")


@pytest.mark.parametrize(
    ("noise", "noisy", "exact"),
    [
        ({"noise_m": 1e-3, "noise_rad": 0.0}, POSITION, ROTATION_VECTOR),
        ({"noise_m": 0.0, "noise_rad": 1e-3}, ROTATION_VECTOR, POSITION),
    ],
    ids=["positions", "orientations"],
)
def test_noise_has_the_planned_size(robot, exact_table, noise, noisy, exact):
    table = draw_measurements(robot, replace(PLAN, **noise), 1, "exact")
    error = np.array([table[name] - exact_table[name] for name in noisy])
    without_largest = np.sort(error**2, axis=1)[:, :-10]
    assert 0.5e-3 < np.sqrt(without_largest.mean()) < 2e-3
    for name in exact:
        assert (table[name] == exact_table[name]).all()
