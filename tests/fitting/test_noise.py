"""Noise from repeats: what was put in comes out, within what so many repeats can tell."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import check_grad
from scipy.stats import chi2
from support import chain_of
from synthetic import made_estimate, made_measurements, made_model

from elastocal.campaigns.campaign import Campaign, Target
from elastocal.fitting import noise as noise_module
from elastocal.fitting.noise import FEWEST, Noise, chosen_noise, declared_noise, measurement_covariances, noise_from_repeats

TARGETS = tuple(Target(name, point, (0.1, 0.05, 0.0)) for name, point in (("A", "6DoF"), ("B", "3DoF"), ("C", "2DoF")))
SENSOR_M, SENSOR_RAD = 50e-6, 30e-6


def campaign(robot, **noise):
    return Campaign("c", robot, "position", "base", TARGETS, "nominal", (), noise or None, {}, None)


def drawn(robot, seed, poses=20, repeats=5, joint_rad=0.0, rows=3, targets=TARGETS):
    model = made_model(robot.chain, targets, rows, fitted_frames=False, compliance=robot.compliance)
    rng = np.random.default_rng(seed)
    measurements = made_measurements(model, rng, poses, repeats, SENSOR_M, joint_rad, SENSOR_RAD)
    return model, made_estimate(model), measurements


def band(freedom):
    """Range of a standard deviation from so many degrees of freedom, 99.9 % of the time."""
    return np.sqrt(chi2.ppf([5e-4, 1 - 5e-4], freedom) / freedom)


@pytest.mark.parametrize("rows", [3, 6])
def test_sensor_alone_is_found_and_no_joints_are_made_up(fanuc, rows):
    found = noise_from_repeats(*drawn(fanuc, 1, rows=rows))
    low, high = band(20 * 4 * 9)
    assert found.source == "repeats" and found.degrees_of_freedom == 20 * 4 * 3 * rows
    assert low < found.position_m / SENSOR_M < high
    assert low < found.orientation_rad / (SENSOR_RAD if rows == 6 else SENSOR_M) < high
    np.testing.assert_array_equal(found.joint_rad, 0.0)


def test_joints_are_made_up_seldom(fanuc):
    made_up = sum(noise_from_repeats(*drawn(fanuc, seed, poses=8, repeats=3)).joint_rad.any() for seed in range(6))
    assert made_up <= 1


@pytest.mark.parametrize("rows", [3, 6])
def test_sensor_and_joints_are_told_apart(rows):
    # Two joints that are seen by several targets each.
    chain = chain_of("Tz(0.4) Rz(q1) Tx(0.1) Ry(q2) Tx(0.9) [hand]")
    targets = tuple(
        Target(str(n), "hand", offset) for n, offset in enumerate([(0.0, 0.1, 0.0), (0.3, 0.0, 0.2), (-0.4, 0.2, 0.1)])
    )
    model = made_model(chain, targets, rows, fitted_frames=False)
    true = np.array([40e-6, 90e-6])
    approaches = 60 * 3
    found, ratios = [], []
    for seed in range(3):
        measurements = made_measurements(model, np.random.default_rng(seed), 60, 4, SENSOR_M, true, SENSOR_RAD)
        found.append(noise_from_repeats(model, made_estimate(model), measurements))
        ratios.append(found[-1].joint_rad / true)
    low, high = band(approaches)
    sensor_low, sensor_high = band(approaches * 7)
    for one, ratio in zip(found, ratios, strict=True):
        assert sensor_low < one.position_m / SENSOR_M < sensor_high
        if rows == 6:
            assert sensor_low < one.orientation_rad / SENSOR_RAD < sensor_high
        # Each joint is seen once an approach; it is taken larger by design, to be on the safe side at 80 %.
        per_joint = one.degrees_of_freedom // 3
        inflation = np.sqrt(per_joint / chi2.ppf(0.2, per_joint))
        assert ((low < ratio / inflation) & (ratio / inflation < high)).all()


def test_part_of_the_joints_is_seen_whatever_the_frame(fanuc):
    """A frame that is turned turns the repeats with it: the noise must be the same."""
    model, estimate, measurements = drawn(fanuc, 3, joint_rad=60e-6)
    turned = replace(model, fitted_frames=True)
    frames = made_estimate(turned, seed=4)
    other = measurements.position @ frames.frame_rotation[0].T + frames.frame_position[0]
    there = replace(estimate, frame_rotation=frames.frame_rotation, frame_position=frames.frame_position)
    one, two = (
        noise_from_repeats(model, estimate, measurements),
        noise_from_repeats(turned, there, replace(measurements, position=other)),
    )
    assert one.joint_rad.any()
    np.testing.assert_allclose(two.position_m, one.position_m, rtol=1e-3)
    np.testing.assert_allclose(two.joint_rad, one.joint_rad, rtol=0.02, atol=1e-6)


def test_noise_does_not_hang_on_what_the_model_lacks(fanuc):
    """Only differences between repeats count: a robot a millimetre off is as noisy as any."""
    model, estimate, measurements = drawn(fanuc, 5)
    off = 1e-3 * np.random.default_rng(6).standard_normal((20, 3, 3))[measurements.pose, measurements.target]
    one, two = (
        noise_from_repeats(model, estimate, replace(measurements, position=measurements.position + o)) for o in (0, off)
    )
    np.testing.assert_allclose(two.position_m, one.position_m, rtol=1e-6)


@pytest.mark.parametrize(("poses", "repeats"), [(20, 1), (1, 2)])
def test_too_few_repeats_say_nothing(fanuc, poses, repeats):
    one_target = TARGETS[:1]
    model, estimate, measurements = drawn(fanuc, 7, poses=poses, repeats=repeats, targets=one_target)
    assert 3 * poses * (repeats - 1) < FEWEST
    assert noise_from_repeats(model, estimate, measurements) is None
    declared = campaign(fanuc, position_m=1e-4, orientation_rad=2e-4)
    noise, warnings = chosen_noise(declared, model, estimate, measurements)
    assert (noise.source, noise.position_m, noise.orientation_rad, noise.degrees_of_freedom) == ("declared", 1e-4, 2e-4, 0)
    assert not noise.joint_rad.any() and warnings == []


def test_few_repeats_tell_the_sensor_but_not_the_joints(fanuc):
    found = noise_from_repeats(*drawn(fanuc, 8, poses=5, repeats=2, joint_rad=1e-3))
    assert found.degrees_of_freedom == 45 and not found.joint_rad.any()
    assert found.position_m > 3 * SENSOR_M


def test_repeats_missing_a_target_are_left_out_and_the_others_kept(fanuc):
    model, estimate, measurements = drawn(fanuc, 9, poses=10, repeats=3)
    incomplete = (measurements.pose == 0) & (measurements.repeat == 1) & (measurements.target == 2)
    found = noise_from_repeats(model, estimate, measurements.select(~incomplete))
    assert found.degrees_of_freedom == (9 * 2 + 1) * 9


@pytest.mark.parametrize("rows", [3, 6])
def test_a_few_wild_repeats_do_not_raise_the_noise(fanuc, rows):
    """Two in a hundred, each thirty standard deviations off: of the mean square they would make nineteen times the noise."""
    model, estimate, measurements = drawn(fanuc, 13, poses=40, rows=rows, joint_rad=20e-6)
    rng = np.random.default_rng(14)
    outlying = rng.permutation(len(measurements))[: len(measurements) // 50]
    off = rng.standard_normal((len(outlying), 3))
    moved = measurements.position.copy()
    moved[outlying] += 30 * SENSOR_M * off / np.linalg.norm(off, axis=1, keepdims=True)
    clean, found = (
        noise_from_repeats(model, estimate, replace(measurements, position=p)) for p in (measurements.position, moved)
    )
    assert found.position_m == pytest.approx(clean.position_m, rel=0.03)
    assert found.orientation_rad == pytest.approx(clean.orientation_rad, rel=0.03)
    # What is left of a state without one of its measurements tells a little less.
    assert 0.85 * clean.degrees_of_freedom < found.degrees_of_freedom < clean.degrees_of_freedom
    # These targets tell little of the joints of the wrist.
    np.testing.assert_allclose(found.joint_rad[:3], clean.joint_rad[:3], rtol=0.15)


def test_declared_noise_is_that_of_the_campaign(fanuc):
    assert declared_noise(campaign(fanuc)) is None
    found = declared_noise(campaign(fanuc, position_m=1e-4))
    assert (found.position_m, found.orientation_rad, found.source) == (1e-4, 1e-4, "declared")


def test_nothing_said_of_noise_is_a_warning(fanuc):
    noise, warnings = chosen_noise(campaign(fanuc), *drawn(fanuc, 10, repeats=1))
    assert noise is None and len(warnings) == 1 and "noise" in warnings[0]


@pytest.mark.parametrize(("factor", "warned"), [(1.0, False), (2.0, True), (0.5, True)])
def test_declared_noise_is_checked_against_repeats_which_are_used(fanuc, factor, warned):
    drawn_data = drawn(fanuc, 11)
    noise, warnings = chosen_noise(campaign(fanuc, position_m=factor * SENSOR_M), *drawn_data)
    assert noise.source == "repeats"
    np.testing.assert_allclose(noise.position_m, SENSOR_M, rtol=0.1)
    assert len(warnings) == warned
    if warned:
        assert f"{noise.position_m / (factor * SENSOR_M):.2f} times" in warnings[0]


@pytest.mark.parametrize("rows", [3, 6])
def test_covariance_is_that_of_simulated_measurements(rows):
    rng = np.random.default_rng(12)
    jacobian = rng.standard_normal((1, 2, rows, 4))
    noise = Noise("", 0.7, 0.3, np.array([0.5, 0.0, 1.0, 0.2]))
    joints = noise.joint_rad * rng.standard_normal((200000, 4))
    sensor = np.array([0.7] * 3 + [0.3] * 3)[:rows] * rng.standard_normal((200000, 2, rows))
    drawn_rows = (np.einsum("tri,si->str", jacobian[0], joints) + sensor).reshape(200000, -1)
    found = measurement_covariances(noise, jacobian, rows)[0]
    np.testing.assert_allclose(found, np.cov(drawn_rows.T), rtol=0, atol=0.02 * found.max())


@pytest.mark.parametrize("rows", [3, 6])
def test_derivatives_of_the_likelihood_agree_with_differences(fanuc, rows, monkeypatch):
    seen = {}
    real = noise_module.minimize

    def spy(function, start, data, *rest, **options):
        seen.update(function=function, start=start, data=data)
        return real(function, start, data, *rest, **options)

    monkeypatch.setattr(noise_module, "minimize", spy)
    noise_from_repeats(*drawn(fanuc, 2, poses=8, joint_rad=2e-5, rows=rows))
    at = seen["start"] + np.random.default_rng(3).normal(0, 0.2, len(seen["start"]))
    slope = seen["function"](at, *seen["data"])[1]
    error = check_grad(lambda x: seen["function"](x, *seen["data"])[0], lambda x: seen["function"](x, *seen["data"])[1], at)
    assert error < 1e-4 * np.linalg.norm(slope)


@pytest.mark.parametrize("rows", [3, 6])
def test_repeats_that_do_not_differ_say_nothing(fanuc, rows):
    """A sensor that stands still has no noise to be found; what is declared is used."""
    model, estimate, measurements = drawn(fanuc, 1, rows=rows)
    still = replace(measurements, position=np.ones_like(measurements.position))
    if rows == 6:
        still = replace(still, rotation_vector=np.zeros_like(still.rotation_vector))
    assert noise_from_repeats(model, estimate, still) is None
    taken, warnings = chosen_noise(campaign(fanuc, position_m=5e-5), model, estimate, still)
    assert taken.source == "declared" and warnings == []
