"""Simulated data sets as in the paper: random loads with the right distribution, exact
deflections, noise."""

from dataclasses import replace

import numpy as np
import pytest
from made_study_blocks import (
    AT,
    WRENCH,
    deflections_of,
    experiments_of,
    identified,
    joined,
)
from scipy.spatial.transform import Rotation
from scipy.stats import kstest
from support import OTHER_CHAINS, PinocchioPoint, robot_of, without_tool

from elastocal.mechanics.kinematics import compute_poses
from elastocal.study import simulation
from elastocal.study.evaluation import unpack_weights
from elastocal.study.simulation import (
    DATA_SETS,
    TESTS,
    Loading,
    RandomDesign,
    draw_bootstrap_weights,
    draw_measurement_noise,
    draw_random_experiments,
    draw_weight_blocks,
    simulate_blocks,
    summarize_displacements,
    unpack_deflections,
)

PAPER = Loading(1000.0, (0.0, 0.5, 0.0), "base", "full_turn")


def draw(
    robot,
    loading=PAPER,
    seed=1,
    key="kuka",
    purpose="identification",
    data_sets=range(4),
    configurations=5,
):
    design = RandomDesign(robot.chain, robot.joint_limits, loading, key)
    return draw_random_experiments(design, seed, purpose, data_sets, configurations)


@pytest.mark.parametrize(
    "change",
    [{"seed": 2}, {"key": "fanuc"}, {"purpose": "test"}, {"data_sets": range(4, 8)}],
)
def test_another_seed_robot_purpose_or_set_gives_other_experiments(kuka, change):
    loads = draw(kuka)
    other_loads = draw(kuka, **change)
    assert not np.isin(loads.joint_angles, other_loads.joint_angles).any()
    assert not np.isin(loads.wrench[..., :3], other_loads.wrench[..., :3]).any()


def test_forces_are_uniform_on_the_sphere(kuka):
    direction = (
        draw(kuka, data_sets=range(20), configurations=1000)
        .wrench[..., :3]
        .reshape(-1, 3)
        / 1000
    )
    five_sigma = 5 / np.sqrt(len(direction))
    # With 20,000 values, a Kolmogorov-Smirnov test at 1e-4 detects a distribution that
    # deviates by 0.025 anywhere, with a power of 0.99. Each component of a direction
    # that is uniform on the sphere is uniform in [-1, 1] (Archimedes).
    for component in direction.T:
        assert kstest(component, "uniform", (-1, 2)).pvalue > 1e-4
    np.testing.assert_allclose(
        direction.mean(axis=0), 0, atol=five_sigma * np.sqrt(1 / 3)
    )
    np.testing.assert_allclose(
        direction.T @ direction / len(direction), np.eye(3) / 3, atol=five_sigma * 0.3
    )
    np.testing.assert_allclose(
        (direction**4).mean(axis=0), 1 / 5, atol=five_sigma * np.sqrt(1 / 9 - 1 / 25)
    )


@pytest.mark.parametrize("joint_range", ["full_turn", "limits"])
def test_joint_angles_are_uniform_over_the_full_turn_or_within_the_limits(
    fanuc, joint_range
):
    loading = replace(PAPER, joint_range=joint_range)
    angles = draw(
        fanuc, loading, data_sets=range(10), configurations=500
    ).joint_angles.reshape(-1, 6)
    ranges = fanuc.joint_limits if joint_range == "limits" else [(-np.pi, np.pi)] * 6
    # With 5,000 values the test detects a deviation of 0.05 with a power of 0.99.
    for joint, (low, high) in zip(angles.T, ranges, strict=True):
        assert kstest(joint, "uniform", (low, high - low)).pvalue > 1e-4
        assert low <= joint.min() and joint.max() <= high


def test_offset_in_the_tool_frame_turns_with_the_tool(kuka):
    base = draw(kuka)
    tool = draw(kuka, replace(PAPER, offset_frame="tool"))
    np.testing.assert_array_equal(tool.joint_angles, base.joint_angles)
    np.testing.assert_array_equal(tool.wrench[..., :3], base.wrench[..., :3])
    rotation = compute_poses(kuka.chain, tool.joint_angles, kuka.chain.end_effector)[1]
    lever = rotation[..., 1] * 0.5
    np.testing.assert_allclose(
        tool.wrench[..., 3:], np.cross(lever, tool.wrench[..., :3]), rtol=0, atol=1e-10
    )


def test_noise_is_standard_normal_and_independent_between_components():
    noise = draw_measurement_noise(1, "kuka", "6DoF", range(20), 500).reshape(-1, 6)
    # With 10,000 values the test detects a deviation of 0.035 with a power of 0.99, which
    # is that of a standard deviation wrong by 16 %.
    for component in noise.T:
        assert kstest(component, "norm").pvalue > 1e-4
    np.testing.assert_allclose(
        np.corrcoef(noise.T), np.eye(6), atol=5 / np.sqrt(len(noise))
    )


def test_numbers_of_a_data_set_do_not_depend_on_how_many_there_are_or_how_long_they_are(
    kuka,
):
    few = joined(experiments_of(kuka, 2, 3))
    many = joined(experiments_of(kuka, 5, 4))
    shared = (many["data_set"] < 2) & (many["configuration"] < 3)
    for name, values in few.items():
        np.testing.assert_array_equal(many[name][shared], values)


def pose_difference(point, before, after):
    """Displacement and rotation vector (6,) of a point between two configurations."""
    position, rotation = point.pose_and_jacobian(before)[:2]
    new_position, new_rotation = point.pose_and_jacobian(after)[:2]
    turn = Rotation.from_matrix(new_rotation @ rotation.T).as_rotvec()
    return [*(new_position - position), *turn]


@pytest.mark.parametrize("at", AT)
@pytest.mark.parametrize("name", ["three joints", "fixed rotations"])
def test_ideal_deflections_are_pose_differences_by_pinocchio_after_the_joints_yield(
    name, at
):
    robot = robot_of(OTHER_CHAINS[name])
    experiments = experiments_of(robot, sets=2, configurations=2)
    blocks = list(simulate_blocks(experiments, robot, at))
    names = [point.name for point in robot.chain.points]
    assert [block["point"] for block in blocks] == names
    loads = joined(experiments)
    angles = np.column_stack([loads[f"q{j + 1}"] for j in range(robot.joints)])
    wrench = np.column_stack([loads[component] for component in WRENCH])
    for block, point in zip(blocks, robot.chain.points, strict=True):
        assert block["data_set"].tolist() == [0, 0, 1, 1]
        assert block["configuration"].tolist() == [0, 1, 0, 1]
        loaded_point = point
        if at == "end_effector":
            loaded_point = without_tool(robot.chain.end_effector)
        deflections = unpack_deflections(block).reshape(-1, 6)
        for q, force, deflection in zip(angles, wrench, deflections, strict=True):
            jacobian = PinocchioPoint(robot.chain, loaded_point).pose_and_jacobian(q)[2]
            yielded = q + robot.compliance * (jacobian.T @ force)
            expected = pose_difference(PinocchioPoint(robot.chain, point), q, yielded)
            np.testing.assert_allclose(deflection, expected, rtol=0, atol=1e-12)


def test_measurements_are_ideal_plus_scaled_noise_of_each_point(kuka):
    experiments = experiments_of(kuka)
    ideal = deflections_of(kuka, experiments)
    for noise in (5e-5, 5e-4):
        measured = deflections_of(kuka, experiments, noise)
        for name in ideal:
            error = unpack_deflections(measured[name][0]) - unpack_deflections(
                ideal[name][0]
            )
            expected = noise * draw_measurement_noise(1, "kuka", name, range(5), 4)
            np.testing.assert_allclose(error, expected, rtol=0, atol=1e-15)


def test_statistics_are_of_the_lengths_of_the_displacements_set_by_set():
    """The lengths are 5 and 1, and 7 and 13; the rotations do not count."""
    statistics = summarize_displacements(
        np.pad(
            [[[3.0, 4, 0], [0, 0, 1]], [[2, 3, 6], [0, -5, 12]]],
            ((0, 0), (0, 0), (0, 3)),
            constant_values=9,
        )
    )
    expected = {
        "mean": [3.0, 10.0],
        "mean_square": [13.0, 109.0],
        "maximum": [5.0, 13.0],
    }
    assert {name: values.tolist() for name, values in statistics.items()} == expected


def test_the_weights_table_gives_back_the_weights_whatever_its_blocks(monkeypatch):
    for size in (500, 5, 2):
        monkeypatch.setattr(simulation, "SETS_PER_BLOCK", size)
        *sets, tests = draw_weight_blocks("kuka", 1, 5, 7, 4)
        assert [block["members"] for block in sets] == [DATA_SETS] * -(
            -5 // size
        ) and tests["members"] == TESTS
        np.testing.assert_array_equal(
            np.hstack([unpack_weights(b) for b in sets]),
            draw_bootstrap_weights(1, "kuka", range(5), 4),
        )
        assert unpack_weights(tests).shape == (5, 7)


def test_numbers_do_not_depend_on_blocks(kuka, strategies, monkeypatch):
    tables = []
    for size in (500, 5, 2, 1):
        monkeypatch.setattr(simulation, "SETS_PER_BLOCK", size)
        experiments = experiments_of(kuka)
        assert len(experiments) == -(-5 // size)
        deflections = deflections_of(kuka, experiments, noise=2e-4)
        table = identified(
            kuka, strategies["4-6DoF-after-6+3DoF"], experiments, deflections
        )
        tables.append((joined(experiments), joined(deflections["3DoF"]), table))
    for table in tables[1:]:
        for name, values in tables[0][0].items():
            np.testing.assert_array_equal(table[0][name], values)
        for name in ("dx", "rz"):
            # Full SIMD vectors and their remainders may round differently.
            np.testing.assert_allclose(
                table[1][name], tables[0][1][name], rtol=0, atol=1e-14
            )
        for name, values in tables[0][2].items():
            np.testing.assert_allclose(
                table[2][name], values, rtol=1e-6, atol=1e-12, err_msg=name
            )
