"""What a certificate states: repeatability after ISO 9283, errors over the workspace, the error budget."""

from dataclasses import replace

import numpy as np
import pytest
from made_calibrated import USUAL, made_calibrated
from scipy.stats import chi
from support import robot_of
from synthetic import made_measurements, made_model, made_states

from elastocal.application.calibrated import OperatingConditions, forward, nominal_forward
from elastocal.application.certificate import (
    REPEATABILITY,
    TOTAL,
    UNCERTAINTY,
    draw_angles,
    error_budget,
    of_sensor,
    repeatability,
    workspace_errors,
)
from elastocal.campaigns.campaign import Target
from elastocal.fitting.parameters import stepped

TARGETS = (Target("A", "6DoF", (0.0, 0.0, 0.0)), Target("B", "3DoF", (0.0, 0.0, 0.0)))
NOISE_M = 50e-6


def measure(fanuc, poses, repeats, seed=0, rows=3, noise=NOISE_M):
    model = made_model(fanuc.chain, TARGETS, rows, fitted_frames=False, compliance=fanuc.compliance)
    return made_measurements(model, np.random.default_rng(seed), poses, repeats, noise, 0.0, 30e-6)


@pytest.mark.parametrize("repeats", [2, 4, 30])
def test_noise_alone_has_the_repeatability_of_a_chi_distribution(fanuc, repeats):
    """3600 lengths: 5 % is three standard errors. Without the degree of freedom, two repeats give 30 % less."""
    found = repeatability(measure(fanuc, 3600 // repeats, repeats), TARGETS, "6DoF")
    expected = (chi.mean(3) + 3 * chi.std(3)) * NOISE_M
    # Of two repeats both lengths are the same one.
    assert found.position_m == pytest.approx(expected, rel=0.05)
    assert of_sensor(NOISE_M) == pytest.approx(expected)
    assert (found.poses, found.approaches) == (3600 // repeats, 3600 // repeats * repeats)


def test_ten_poses_of_four_have_an_interval_that_holds_the_value(fanuc):
    """95 % of 60; 50 or fewer have a probability of 2e-4 there, and of 0.5 where it held 84 %."""
    expected = of_sensor(NOISE_M)
    found = [repeatability(measure(fanuc, 10, 4, seed), TARGETS, "6DoF").position_interval_m for seed in range(60)]
    assert sum(low <= expected <= high for low, high in found) > 50


def test_orientations_count_where_they_are_measured(fanuc):
    assert repeatability(measure(fanuc, 10, 4), TARGETS, "6DoF").orientation_rad is None
    found = repeatability(measure(fanuc, 600, 6, rows=6), TARGETS, "6DoF")
    assert found.orientation_rad == pytest.approx(of_sensor(30e-6), rel=0.05)


def test_only_targets_of_the_end_effector_count_unless_there_is_none(fanuc):
    data = measure(fanuc, 20, 4)
    size = np.where((data.target == 1)[:, None], 1e-2, 1e-4)
    off = size * np.random.default_rng(1).standard_normal(data.position.shape)
    worse = replace(data, position=data.position + off)
    assert repeatability(worse, TARGETS, "6DoF").position_m < 1e-3
    assert repeatability(worse, TARGETS, "2DoF").position_m > 1e-2


def test_without_repeats_nothing_is_known(fanuc):
    assert repeatability(measure(fanuc, 5, 1), TARGETS, "6DoF") is None
    assert repeatability(measure(fanuc, 1, 5), TARGETS, "6DoF") is None


def states(robot, count=60, force=300.0, seed=0):
    rng = np.random.default_rng(seed)
    low, high = robot.joint_limits.T
    wrench = np.zeros((count, 6))
    wrench[:, :3] = force * rng.standard_normal((count, 3))
    return robot.reported_angles(rng.uniform(0.6 * low, 0.6 * high, (count, robot.joints))), OperatingConditions(wrench)


def budget(calibrated, draws=2000, **options):
    lines = error_budget(calibrated, *states(calibrated.robot, **options), draws, np.random.default_rng(1))
    return {line.name: line for line in lines}


def rms(one, other):
    return np.sqrt(((one - other) ** 2).sum(axis=1).mean())


def test_each_line_is_what_the_robot_misses_without_that_effect(fanuc):
    calibrated = made_calibrated(fanuc, *USUAL)
    found = budget(calibrated)
    angles, operating = states(fanuc)
    whole, _ = forward(calibrated, angles, operating)
    assert found[TOTAL].rms_m == pytest.approx(rms(whole, nominal_forward(fanuc, angles)[0]))
    for name in ("joint_offset", "link_geometry", "joint_compliance", "link_weight"):
        values = tuple(
            0.0 * value if effect.effect == name else value
            for effect, value in zip(calibrated.model.effects, calibrated.estimate.coefficients, strict=True)
        )
        without = replace(calibrated, estimate=replace(calibrated.estimate, coefficients=values))
        assert found[name].rms_m == pytest.approx(rms(whole, forward(without, angles, operating)[0]))
    names = list(found)
    assert names[0] == TOTAL and names[-2:] == [UNCERTAINTY, REPEATABILITY]
    middle = [found[name].rms_m for name in names[1:-2]]
    assert middle == sorted(middle, reverse=True)


def test_a_parameter_known_to_a_tenth_has_a_line_known_to_a_tenth():
    """One joint offset: the line is |a| times its lever, and so is its interval."""
    calibrated = made_calibrated(robot_of("Rz(q1) Tx(1.0) Ry(q2) Tx(0.5) [tip]"), "joint_offset@2", identified=False)
    value = calibrated.estimate.coefficients[0][0]
    line = budget(replace(calibrated, covariance=np.array([[(0.1 * value) ** 2]])), 20_000)["joint_offset"]
    assert line.rms_m == pytest.approx(0.5 * abs(value), rel=1e-3)
    assert line.low_m / line.rms_m == pytest.approx(1 - 0.196, abs=0.01)
    assert line.high_m / line.rms_m == pytest.approx(1 + 0.196, abs=0.01)


def test_a_shape_that_is_known_widens_no_line(fanuc):
    """It does not contribute in proportion: the interval is that of the linear parameter, known to a tenth."""
    calibrated = made_calibrated(fanuc, "lost_motion@2", identified=False)
    value = calibrated.estimate.coefficients[-1][0]
    covariance = np.zeros_like(calibrated.covariance)
    covariance[-2, -2] = (0.1 * value) ** 2
    line = budget(replace(calibrated, covariance=covariance), 20_000)["lost_motion"]
    assert line.low_m / line.rms_m == pytest.approx(1 - 0.196, abs=0.01)
    assert line.high_m / line.rms_m == pytest.approx(1 + 0.196, abs=0.01)


def test_bounds_over_the_workspace_hold_95_percent_of_robots_drawn_from_the_covariance(fanuc):
    """100 robots at 100 poses; robots err at many poses alike, so that the share is known to some 2 %."""
    calibrated = made_calibrated(fanuc, *USUAL)
    noise = replace(calibrated.noise, joint_rad=np.full(6, 1e-5))
    angles, states = draw_angles(calibrated, 100, np.random.default_rng(0)), made_states(6, 50)
    narrow = fanuc.model_angles(angles[:50]) * [0.5, 1.0, 1.0, 1.0, 1.0, 1.0]
    calibrated = replace(calibrated, noise=noise, fitted=replace(states, joint_angles=narrow))
    found = workspace_errors(calibrated, angles, np.zeros(6))
    rng, root, inside = np.random.default_rng(2), np.linalg.cholesky(calibrated.covariance), []
    for _ in range(100):
        step = root @ rng.standard_normal(len(root))
        other = replace(calibrated, estimate=stepped(calibrated.model, calibrated.estimate, step))
        repeated = found.joint_angles + 1e-5 * rng.standard_normal(found.joint_angles.shape)
        inside.append(np.linalg.norm(forward(other, repeated)[0] - found.position, axis=1) < found.bound_m)
    assert np.mean(inside) == pytest.approx(0.95, abs=0.03)
    assert 20 < found.outside.sum() < 80
