"""Noise from repeats: what was put in comes out, within what so many repeats can tell;
else what the declared model leaves.

Declared geometry has one prior, whose size the measurements make most probable; and
what priors leave of parameters.
"""

from dataclasses import replace

import numpy as np
import pytest
from made_campaigns import Plan, make_campaign
from planted import planted
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation
from scipy.stats import chi2
from support import chain_of
from synthetic import make_estimate, make_measurements, make_model

from elastocal.campaigns.campaign import Campaign, Target
from elastocal.fitting import noise as noise_module
from elastocal.fitting.least_squares import fit_model
from elastocal.fitting.model import Case, build_declared_model
from elastocal.fitting.noise import (
    PRIOR_SCALES,
    Noise,
    choose_noise,
    count_effective_parameters,
    estimate_joint_repeatability,
    estimate_noise,
    estimate_noise_from_repeats,
    find_declared_geometry,
    fit_declared_model,
    maximize_evidence,
    parse_noise,
    serialize_noise,
    set_prior_scale,
)
from elastocal.fitting.observations import average_repeats

TARGETS = tuple(
    Target(name, point, (0.1, 0.05, 0.0))
    for name, point in (("A", "6DoF"), ("B", "3DoF"), ("C", "2DoF"))
)
SENSOR_M = 50e-6
SENSOR_RAD = 30e-6


def campaign(robot, **noise):
    nothing = drawn(robot, 0, poses=1, repeats=1)[2]
    return Campaign(
        "c",
        robot,
        "position",
        "base",
        TARGETS,
        "nominal",
        (),
        noise or None,
        {},
        nothing,
    )


def drawn(robot, seed, poses=20, repeats=5, joint_rad=0.0, rows=3, targets=TARGETS):
    model = make_model(
        robot.chain, targets, rows, fitted_frames=False, compliance=robot.compliance
    )
    rng = np.random.default_rng(seed)
    measurements = make_measurements(
        model, rng, poses, repeats, SENSOR_M, joint_rad, SENSOR_RAD
    )
    return model, make_estimate(model), measurements


def test_uncertainties_of_measurements_are_the_declared_noise(fanuc):
    stated = campaign(fanuc)
    u95 = 1.959964 * np.array([3e-5, 4e-5, 5e-5])
    stated = replace(stated, measurements=replace(stated.measurements, u95_m=u95))
    found = choose_noise(stated, *drawn(fanuc, 0, poses=1, repeats=1)[:2])[0]
    assert found.position_m == pytest.approx(1e-5 * np.sqrt(50 / 3))


HANDS = tuple(Target(name, "hand", (0.0, 0.0, 0.0)) for name in "AB")


def off_by(model, off, turned=None):
    """Repeats that are off the model by exactly so much: ndarray (poses, repeats,
    targets, 3), m and rad."""
    exact = make_measurements(
        model, np.random.default_rng(20), *off.shape[:2], 0.0, 0.0
    )
    moved = replace(exact, position=exact.position + off.reshape(-1, 3))
    if turned is None:
        return moved
    vectors = Rotation.from_rotvec(turned.reshape(-1, 3)) * Rotation.from_rotvec(
        exact.rotation_vector
    )
    return replace(moved, rotation_vector=vectors.as_rotvec())


def mirrored(parts):
    """Two repeats either side of the middle, whose contrasts are exactly `parts`,
    ndarray (poses, targets, 3)."""
    return np.stack([-parts, parts], axis=1) / np.sqrt(2)


def gantry(text="Tx(q1) [hand]", targets=1, rows=3):
    """A model whose joints shift or turn all targets alike in every pose, so that the
    likelihood has a closed form."""
    model = make_model(chain_of(text), HANDS[:targets], rows, fitted_frames=False)
    return model, make_estimate(model)


def safe_side(approaches):
    """By how much the joint part is taken larger than it seems: so that it is large
    enough four times of five."""
    return np.sqrt(approaches / chi2.ppf(0.2, approaches))


@pytest.mark.parametrize("rows", [3, 6])
def test_few_repeats_have_the_pooled_standard_deviation_of_states_with_different_numbers_of_them(
    rows,
):
    """Squares about the mean of each state and target over their degrees of freedom,
    positions and orientations apart."""
    model, estimate = gantry("Tz(0.4) Rz(q1) Tx(0.7) Ry(q2) Tx(0.6) [hand]", 2, rows)
    rng = np.random.default_rng(21)
    off = SENSOR_M * rng.standard_normal((3, 4, 2, 3))
    turned = SENSOR_RAD * rng.standard_normal((3, 4, 2, 3))
    measurements = off_by(model, off, turned if rows == 6 else None)
    # Pose 0 has two repeats of one target, pose 1 three of both and one of the first
    # alone, which tells nothing, pose 2 four.
    repeats = np.array([2, 3, 4])
    targets = np.array([1, 2, 1])
    there = (measurements.repeat < repeats[measurements.pose]) & (
        measurements.target < targets[measurements.pose]
    )
    alone = (
        (measurements.pose == 1)
        & (measurements.repeat == 3)
        & (measurements.target == 0)
    )
    found = estimate_noise_from_repeats(
        model, estimate, measurements.select(there | alone)
    )
    parts = [
        values[pose, : repeats[pose], : targets[pose]]
        for values in (off, turned)
        for pose in range(3)
    ]
    squares = [((part - part.mean(axis=0)) ** 2).sum() for part in parts]
    freedom = 3 * ((repeats - 1) * targets).sum()
    assert found.degrees_of_freedom == freedom * rows // 3
    assert found.position_m == pytest.approx(
        np.sqrt(sum(squares[:3]) / freedom), rel=1e-6
    )
    expected = found.position_m if rows == 3 else np.sqrt(sum(squares[3:]) / freedom)
    assert found.orientation_rad == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("rows", [3, 6])
def test_a_joint_that_shifts_all_targets_has_the_maximum_of_its_likelihood_in_closed_form(
    rows,
):
    """What two targets make along the joint together has variance 2 s^2 + sigma^2,
    every other direction sigma^2."""
    model, estimate = gantry(targets=2, rows=rows)
    rng = np.random.default_rng(23)
    parts = SENSOR_M * rng.standard_normal((40, 2, 3))
    parts[..., 0] += 80e-6 * rng.standard_normal((40, 1))
    turns = SENSOR_RAD * rng.standard_normal((40, 2, 3))
    found = estimate_noise_from_repeats(
        model,
        estimate,
        off_by(model, mirrored(parts), mirrored(turns) if rows == 6 else None),
    )
    together = (parts[..., 0].sum(axis=1) ** 2).sum() / 2
    sensor = ((parts**2).sum() - together) / (40 * 5)
    assert found.position_m == pytest.approx(np.sqrt(sensor), rel=1e-3)
    assert found.orientation_rad == pytest.approx(
        np.sqrt((turns**2).mean() if rows == 6 else sensor), rel=1e-3
    )
    # Two targets see the same forty draws of the joint.
    assert found.joint_rad[0] == pytest.approx(
        np.sqrt((together / 40 - sensor) / 2) * safe_side(40), rel=1e-3
    )


@pytest.mark.parametrize("joints", [1, 2, 3])
def test_joints_are_taken_where_they_raise_the_log_likelihood_by_more_than_one_each(
    joints,
):
    """Akaike's criterion, at contrasts for which the gain over the sensor alone is
    known exactly."""
    model, estimate = gantry(
        " ".join(f"Tx(q{number})" for number in range(1, joints + 1)) + " [hand]"
    )
    poses = 40

    def gain(ratio):
        return 0.5 * poses * (3 * np.log((ratio**2 + 2) / 3) - np.log(ratio**2))

    for off, taken in ((-0.05, False), (0.05, True)):
        ratio = brentq(lambda ratio, off=off: gain(ratio) - joints - off, 1.0, 10.0)
        parts = SENSOR_M * np.array([ratio, 1.0, 1.0]) * np.ones((poses, 1, 3))
        found = estimate_noise_from_repeats(
            model, estimate, off_by(model, mirrored(parts))
        )
        assert found.joint_rad.any() == taken, ratio


def test_of_more_contrasts_than_are_needed_those_of_states_spread_over_the_campaign_are_taken(
    monkeypatch,
):
    """The later half is three times as noisy: a half of the states shows both halves
    alike."""
    model, estimate = gantry()
    parts = SENSOR_M * np.repeat([1.0, 3.0], 20)[:, None, None] * np.ones((40, 1, 3))
    measurements = off_by(model, mirrored(parts))
    for most, freedom in ((120, 120), (60, 60)):
        monkeypatch.setattr(noise_module, "MAX_CONTRASTS", most)
        found = estimate_noise_from_repeats(model, estimate, measurements)
        assert found.degrees_of_freedom == freedom
        assert found.position_m == pytest.approx(np.sqrt(5) * SENSOR_M, rel=1e-6)


@pytest.mark.parametrize("part", ["approach", "load", "session"])
def test_only_approaches_to_one_state_from_one_side_are_repeats_of_each_other(part):
    """What differs between two senses, loads or sessions is no noise, however much it
    is."""
    model, estimate = gantry()
    estimate = replace(
        estimate,
        sessions=(0, 1),
        frame_rotation=np.tile(np.eye(3), (2, 1, 1)),
        frame_position=np.zeros((2, 3)),
    )
    parts = SENSOR_M * np.random.default_rng(25).standard_normal((5, 2, 1, 3))
    # Of four measurements of a pose the first two and the last two belong together.
    off = np.concatenate([mirrored(parts[:, 0]), 1e-3 + mirrored(parts[:, 1])], axis=1)
    measurements = off_by(model, off)
    later = measurements.repeat // 2
    values = {"approach": 2.0 * later[:, None] - 1.0, "load": later, "session": later}
    found = estimate_noise_from_repeats(
        model, estimate, replace(measurements, **{part: values[part]})
    )
    assert found.degrees_of_freedom == 30
    assert found.position_m == pytest.approx(np.sqrt((parts**2).mean()), rel=1e-6)


@pytest.mark.parametrize("rows", [3, 6])
@pytest.mark.parametrize("end", [0, 1])
def test_declared_noise_is_doubted_beyond_the_range_of_chance_in_a_hundred_campaigns(
    fanuc, rows, end
):
    """The 0.5 and 99.5 % quantiles of a standard deviation from so many contrasts of
    positions."""
    model, estimate = gantry(rows=rows)
    parts = mirrored(SENSOR_M * np.ones((12, 1, 3)))
    measurements = off_by(model, parts, parts if rows == 6 else None)
    limit = np.sqrt(chi2.ppf([0.005, 0.995][end], 36) / 36)
    for share, warned in ((0.999, end == 0), (1.001, end == 1)):
        declared = replace(
            campaign(fanuc, position_m=SENSOR_M / (share * limit)),
            measurements=measurements,
        )
        assert len(choose_noise(declared, model, estimate)[1]) == warned


@pytest.mark.parametrize("joint_rad", [5e-6, 2e-5])
def test_joints_that_the_sensor_hides_are_found_where_all_repeat_alike(
    fanuc, joint_rad
):
    """A tenth to four tenths of the sensor at 2 m: on average over six campaigns within
    a third."""
    found = np.array(
        [
            estimate_joint_repeatability(*drawn(fanuc, seed, joint_rad=joint_rad))
            for seed in range(6)
        ]
    )
    assert np.sqrt((found[:, 0] ** 2).mean()) == pytest.approx(joint_rad, rel=0.35)
    assert (found[:, 1] > 1.0).all()


def test_without_repeats_nothing_is_said_of_joints(fanuc):
    assert estimate_joint_repeatability(*drawn(fanuc, 1, poses=2, repeats=1)) == (
        0.0,
        0.0,
    )


def test_noise_comes_back_from_its_document():
    noise = Noise("repeats", 1e-5, 2e-5, np.array([1e-6, 0, 3e-6]), 77, 2e-6)
    back = parse_noise({"noise": serialize_noise(noise), "warnings": []})
    np.testing.assert_array_equal(back.joint_rad, noise.joint_rad)
    assert replace(back, joint_rad=None) == replace(noise, joint_rad=None)


JOINTS = (2, 3, 4, 5)


def campaign_of(robot, offset, **options):
    """A robot whose joints 2 to 5 are off by an angle or its opposite, and its model
    with these offsets declared."""
    keys = [f"joint_offset@{joint}" for joint in JOINTS]
    campaign = planted(
        robot,
        {key: [offset * (-1) ** n] for n, key in enumerate(keys)},
        seed=2,
        **options,
    )
    return campaign, campaign.declared.model.with_effects(
        [campaign.candidates[key] for key in keys]
    )


def wide_fit(campaign, model, share=1.0):
    return fit_model(
        set_prior_scale(model, PRIOR_SCALES[-1]),
        campaign.observations,
        campaign.declared.noise.scaled(share),
    )


@pytest.mark.parametrize(("offset", "size"), [(1e-4, 0.1), (1e-3, 1.0), (1e-2, 10.0)])
def test_declared_geometry_has_the_size_that_the_measurements_make_most_probable(
    offset, size, kuka
):
    campaign, model = campaign_of(kuka, offset)
    # Springs of the joints have no size: they have no prior.
    assert find_declared_geometry(model) == {"joint_offset"}
    assert maximize_evidence(wide_fit(campaign, model))[0] == pytest.approx(
        size, rel=0.01
    )
    fitted = fit_declared_model(model, campaign.observations, campaign.declared.noise)
    priors = {owner: parameter.prior_std for owner, parameter in fitted.parameters}
    assert [priors[f"joint_offset@{joint}"] for joint in JOINTS] == pytest.approx(
        [size * 1e-3] * 4, rel=0.01
    )
    assert priors["joint_compliance"] is None


@pytest.mark.parametrize("share", [1.0, 0.1, 0.01])
def test_the_size_is_the_same_whatever_noise_was_taken_and_the_noise_comes_back(
    share, kuka
):
    """Noise that is declared far too small must not make sizes small: they would be so
    many standard errors, not so many mm."""
    campaign, model = campaign_of(kuka, 1e-3)
    size, factor = maximize_evidence(wide_fit(campaign, model, share))
    assert size == pytest.approx(1.0, rel=0.01)
    assert factor == pytest.approx(1.0 / share, rel=0.15)


def test_effective_parameters_are_the_trace_of_the_hat_matrix(kuka):
    campaign, model = campaign_of(kuka, 1e-4, poses=6)
    fitted = fit_model(
        set_prior_scale(model, 0.1),
        campaign.observations,
        campaign.declared.noise.scaled(30.0),
    )
    rows = np.concatenate(
        [
            white.reshape(-1, len(fitted.unidentifiable))
            for _, _, white in fitted.iterate_sensitivities(campaign.observations)
        ]
    )
    assert count_effective_parameters(fitted) == pytest.approx(
        np.trace(rows @ fitted.covariance @ rows.T), rel=1e-3
    )
    assert count_effective_parameters(fitted) < (~fitted.unidentifiable).sum() - 0.5


def case_of(robot, off=0.0, turned=0.0, noise=None, oriented=True, repeats=1):
    """A known robot whose measurements are off by so much and turned by so much:
    nothing is left to fit."""
    plan = Plan(
        poses=8, loads=1, repeats=repeats, noise=0.0, force=0.0, oriented=oriented
    )
    campaign = replace(make_campaign(robot, 3, plan), compliance="nominal", noise=noise)
    seen = campaign.measurements
    seen = replace(seen, position=seen.position + off)
    if oriented:
        turns = Rotation.from_rotvec(np.zeros_like(seen.position) + turned)
        vectors = turns * Rotation.from_rotvec(seen.rotation_vector)
        seen = replace(seen, rotation_vector=vectors.as_rotvec())
    campaign = replace(campaign, measurements=seen)
    return Case(campaign, average_repeats(seen), build_declared_model(campaign), {})


def errors(seed, size, repeats=1):
    return size * np.random.default_rng(seed).standard_normal((8 * 2 * 4 * repeats, 3))


@pytest.mark.parametrize("oriented", [False, True])
def test_noise_is_the_root_mean_square_of_the_residual_where_nothing_else_says_it(
    fanuc, oriented
):
    off = errors(1, 70e-6)
    turned = errors(2, 20e-6)
    noise, warnings = estimate_noise(case_of(fanuc, off, turned, oriented=oriented))
    assert (
        noise.source == "residual"
        and noise.degrees_of_freedom == 0
        and noise.pose_rad == 0.0
    )
    assert noise.position_m == pytest.approx(np.sqrt((off**2).mean()), rel=1e-6)
    # Where no orientation is measured it counts as in a declaration, as many radians as
    # metres.
    assert noise.orientation_rad == pytest.approx(
        np.sqrt(((turned if oriented else off) ** 2).mean()), rel=1e-6
    )
    np.testing.assert_array_equal(noise.joint_rad, np.zeros(6))
    assert len(warnings) == 1 and "no repeats and no declared noise" in warnings[0]
