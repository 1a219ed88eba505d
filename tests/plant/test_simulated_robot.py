"""A simulated robot with its instruments: gears, weights, temperature, random errors,
and the readings of its tracker and load cell."""

from dataclasses import replace

import numpy as np
import pytest

from elastocal_proof.plant.arm import to_rotation_matrix, to_rotation_vector
from elastocal_proof.plant.campaigns import Design, draw_schedule
from elastocal_proof.plant.simulated_robot import (
    LoadCell,
    Tracker,
    compute_casting_warming,
    compute_drive_angles,
    compute_logged_temperature,
    draw_specimen,
)


def test_castings_warm_up_behind_the_thermometer_and_reach_its_temperature():
    time = np.linspace(0, 40000, 400)
    logged = compute_logged_temperature(time)
    castings = 20.0 + compute_casting_warming(time)
    assert (castings[1:] < logged[1:]).all()
    assert castings[0] == logged[0] == 20.0
    np.testing.assert_allclose([logged[-1], castings[-1]], 30.0, atol=1e-3)


def test_a_specimen_follows_from_its_seed_and_its_weights_change_no_gear(fanuc_arm):
    heavy = draw_specimen(fanuc_arm, 7)
    weightless = draw_specimen(fanuc_arm, 7, weighs=False)
    offset = draw_specimen(fanuc_arm, 7, off_line_m=0.03)
    np.testing.assert_array_equal(heavy.compliance, weightless.compliance)
    np.testing.assert_array_equal(heavy.compliance, offset.compliance)
    assert heavy.structure == draw_specimen(fanuc_arm, 7).structure
    assert heavy.structure != draw_specimen(fanuc_arm, 8).structure
    assert weightless.structure.masses == ()


@pytest.mark.parametrize(
    ("kind", "group"), [("repeatability_rad", "approach"), ("pose_rad", "pose")]
)
def test_random_errors_of_the_drives_are_drawn_for_each_approach_or_pose_by_the_seed(
    weightless_specimen, fanuc_arm, kind, group
):
    design = Design(poses=60, approach_each_load=False)
    schedule = draw_schedule(fanuc_arm, design, 2)
    robot = replace(weightless_specimen, **{kind: (2e-5, 0.0, 1e-5, 0.0, 0.0, 0.0)})
    error, repeated, of_next_seed = (
        compute_drive_angles(robot, replace(schedule, seed=seed)) - schedule.angle
        for seed in (schedule.seed, schedule.seed, schedule.seed + 1)
    )
    numbers = getattr(schedule, group)
    first = np.unique(numbers, return_index=True)[1]
    np.testing.assert_allclose(error, error[first][numbers], atol=1e-15)
    np.testing.assert_array_equal(error, repeated)
    assert np.abs(error - of_next_seed)[:, 0].min() > 0
    np.testing.assert_allclose(
        error[first].std(axis=0),
        [2e-5, 0.0, 1e-5, 0.0, 0.0, 0.0],
        rtol=0.35,
        atol=1e-15,
    )


@pytest.fixture
def target_poses(rng):
    position = rng.uniform(-2, 2, (500, 4, 3))
    return position, to_rotation_matrix(rng.uniform(-2, 2, (500, 4, 3)))


def test_noise_has_the_stated_deviation_and_grows_with_range(target_poses, rng):
    true_position, true_rotation = target_poses
    tracker = Tracker(sigma_m=2e-5, sigma_m_per_m=1e-5, sigma_rad=5e-5)
    position, rotation = tracker.read(*target_poses, rng)
    distance = np.linalg.norm(true_position - np.array(tracker.stand_m), axis=-1)
    sigma_m = (2e-5 + 1e-5 * distance)[..., None]
    # The standard deviation of 6,000 values is known to 0.9 %. A tolerance of 3 % has a
    # level of 0.1 %, and detects a difference of 5 % with a power of 0.98. That of the
    # 2,000 rotations about each axis is known to 1.6 %; a difference of 9 % is detected
    # with a power of 0.99.
    np.testing.assert_allclose(
        ((position - true_position) / sigma_m).std(), 1.0, rtol=0.03
    )
    turn = to_rotation_vector(rotation @ np.swapaxes(true_rotation, -1, -2))
    np.testing.assert_allclose(turn.std(axis=(0, 1)), 5e-5, rtol=0.05)


def test_outliers_multiply_the_noise_of_their_share_of_the_measurements(target_poses):
    tracker = Tracker(sigma_m=2e-5, sigma_m_per_m=1e-5, sigma_rad=5e-5, outliers=0.1)
    usual_noise, noise = (
        replace(tracker, outlier_sigmas=factor).read(
            *target_poses, np.random.default_rng(3)
        )[0]
        - target_poses[0]
        for factor in (1.0, 30.0)
    )
    ratio = noise / usual_noise
    np.testing.assert_allclose(ratio[ratio > 2.0], 30.0, rtol=1e-9)
    assert (ratio > 2.0).mean() == pytest.approx(0.1, abs=0.03)


@pytest.mark.parametrize("in_flange", [(), ("turn",), ("bias",), ("turn", "bias")])
def test_the_applied_force_is_the_one_for_which_the_cell_displays_the_plan(
    rng, in_flange
):
    force = 500.0 * rng.standard_normal((5, 3))
    flange_rotation = to_rotation_matrix(rng.standard_normal((5, 3)))
    force[2] = 0.0
    errors = {"turn": (0.01, -0.02, 0.03), "bias": (5.0, -3.0, 2.0)}
    cell = LoadCell(0.03, errors, 2e-5, in_flange)
    lever = np.broadcast_to([0.0, 0.5, 0.0], (5, 3))
    wrench = cell.compute_applied_wrench(force, lever, flange_rotation)
    displayed = cell.compute_displayed_force(wrench[:, :3], flange_rotation)
    loaded = force.any(axis=1)
    np.testing.assert_allclose(displayed[loaded], force[loaded], atol=1e-9)
