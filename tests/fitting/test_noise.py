"""Noise estimated from repeats is the simulated noise, within what so many repeats can
show; without repeats it comes from the residual of the declared model.

The declared geometry has one prior, whose scale maximizes the evidence, and effective
parameters are counted.
"""

from dataclasses import replace

import numpy as np
import pytest
from contact_campaigns import (
    build_contact_case,
    open_workshop,
    spread_places,
    touch_crossing_planes,
    write_contacts,
)
from made_campaigns import Plan, make_campaign, make_plan
from planted import planted
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation
from scipy.stats import chi2
from support import chain_of
from synthetic import make_estimate, make_measurements, make_model

from elastocal.campaigns.campaign import Campaign, Target
from elastocal.diagnosis.misplaced import find_misplaced_frames
from elastocal.diagnosis.training_verdict import _state_noise
from elastocal.effects.catalogue import declared_candidates
from elastocal.fitting import noise as noise_module
from elastocal.fitting.least_squares import fit_model
from elastocal.fitting.model import Case, build_declared_model, get_parameter_values
from elastocal.fitting.noise import (
    PRIOR_SCALES,
    Noise,
    choose_noise,
    count_effective_parameters,
    estimate_joint_repeatability,
    estimate_noise,
    estimate_noise_from_repeats,
    find_declared_geometry,
    find_widest_scale,
    fit_declared_model,
    get_noise,
    maximize_evidence,
    parse_noise,
    serialize_noise,
    set_prior_scale,
)
from elastocal.fitting.observations import average_repeats
from elastocal.mechanics.sites import build_sites
from elastocal_proof.plant.contacts import draw_form, seat_in_socket, touch_surface

TARGETS = tuple(
    Target(name, point, (0.1, 0.05, 0.0))
    for name, point in (("A", "6DoF"), ("B", "3DoF"), ("C", "2DoF"))
)
SENSOR_M = 50e-6
FLAT = draw_form(np.random.default_rng(0), 0.0, 1.0)
SENSOR_RAD = 30e-6


def declare_campaign(robot, **noise):
    """Make a campaign with a declared noise, and measurements of a single pose."""
    measurements = simulate_repeats(robot, 0, poses=1, repeats=1)[2]
    return Campaign(
        "c",
        robot,
        make_plan("position"),
        "base",
        TARGETS,
        "nominal",
        (),
        noise or None,
        {},
        measurements,
    )


def simulate_repeats(
    robot, seed, poses=20, repeats=5, joint_rad=0.0, rows=3, targets=TARGETS
):
    """Simulate repeated measurements of a known robot.

    Returns the model, its estimate and the measurements.
    """
    model = make_model(
        robot.chain, targets, rows, fitted_frames=False, compliance=robot.compliance
    )
    rng = np.random.default_rng(seed)
    measurements = make_measurements(
        model, rng, poses, repeats, SENSOR_M, joint_rad, SENSOR_RAD
    )
    return model, make_estimate(model), measurements


def test_uncertainties_of_measurements_are_the_declared_noise(fanuc):
    campaign = declare_campaign(fanuc)
    u95 = 1.959964 * np.array([3e-5, 4e-5, 5e-5])
    campaign = replace(campaign, measurements=replace(campaign.measurements, u95_m=u95))
    model, estimate, _ = simulate_repeats(fanuc, 0, poses=1, repeats=1)
    noise = choose_noise(campaign, model, estimate)[0]
    assert noise.position_m == pytest.approx(1e-5 * np.sqrt(50 / 3))


HANDS = tuple(Target(name, "hand", (0.0, 0.0, 0.0)) for name in "AB")


def measure_with_errors(model, error, rotation_vector=None):
    """Make repeats whose errors are known.

    Parameters
    ----------
    model
        Model that the measurements deviate from.
    error : ndarray (poses, repeats, targets, 3)
        Position errors, m.
    rotation_vector : ndarray of the same shape, optional
        Orientation errors, rad.
    """
    exact = make_measurements(
        model, np.random.default_rng(20), *error.shape[:2], 0.0, 0.0
    )
    measured = replace(exact, position=exact.position + error.reshape(-1, 3))
    if rotation_vector is None:
        return measured
    rotation = Rotation.from_rotvec(
        rotation_vector.reshape(-1, 3)
    ) * Rotation.from_rotvec(exact.rotation_vector)
    return replace(measured, rotation_vector=rotation.as_rotvec())


def make_symmetric_repeats(contrasts):
    """Make two repeats on either side of their mean, whose contrasts are given exactly:
    ndarray (poses, targets, 3)."""
    return np.stack([-contrasts, contrasts], axis=1) / np.sqrt(2)


def make_gantry(text="Tx(q1) [hand]", targets=1, rows=3):
    """Make a model whose joints shift all targets alike in every pose, so that the
    likelihood has a closed form."""
    model = make_model(chain_of(text), HANDS[:targets], rows, fitted_frames=False)
    return model, make_estimate(model)


def compute_safety_factor(approaches):
    """Factor by which the joint noise is reported above its estimate, so that it is
    large enough in four of five campaigns."""
    return np.sqrt(approaches / chi2.ppf(0.2, approaches))


def sum_squares_about_means(errors, repeats, targets):
    """Sum the squares about the mean of each pose and target, for the first repeats and
    targets of each pose."""
    total = 0.0
    for pose, (repeat_count, target_count) in enumerate(
        zip(repeats, targets, strict=True)
    ):
        of_pose = errors[pose, :repeat_count, :target_count]
        total += ((of_pose - of_pose.mean(axis=0)) ** 2).sum()
    return total


@pytest.mark.parametrize("rows", [3, 6])
def test_noise_of_few_repeats_is_the_pooled_standard_deviation(
    rows,
):
    """States have different numbers of repeats. The squares about the mean of each
    state and target are divided by their degrees of freedom, separately for positions
    and orientations."""
    model, estimate = make_gantry(
        "Tz(0.4) Rz(q1) Tx(0.7) Ry(q2) Tx(0.6) [hand]", 2, rows
    )
    rng = np.random.default_rng(21)
    position_errors = SENSOR_M * rng.standard_normal((3, 4, 2, 3))
    rotation_errors = SENSOR_RAD * rng.standard_normal((3, 4, 2, 3))
    measurements = measure_with_errors(
        model, position_errors, rotation_errors if rows == 6 else None
    )
    # Pose 0 has two repeats of one target and pose 2 has four. Pose 1 has three of both
    # targets and a fourth of the first target alone, which carries no information.
    repeats = np.array([2, 3, 4])
    targets = np.array([1, 2, 1])
    complete = (measurements.repeat < repeats[measurements.pose]) & (
        measurements.target < targets[measurements.pose]
    )
    single = (
        (measurements.pose == 1)
        & (measurements.repeat == 3)
        & (measurements.target == 0)
    )
    noise = estimate_noise_from_repeats(
        model, estimate, measurements.select(complete | single)
    )
    freedom = 3 * ((repeats - 1) * targets).sum()
    assert noise.degrees_of_freedom == freedom * rows // 3
    squares = sum_squares_about_means(position_errors, repeats, targets)
    assert noise.position_m == pytest.approx(np.sqrt(squares / freedom), rel=1e-6)
    expected = noise.position_m
    if rows == 6:
        squares = sum_squares_about_means(rotation_errors, repeats, targets)
        expected = np.sqrt(squares / freedom)
    assert noise.orientation_rad == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("rows", [3, 6])
def test_noise_of_a_joint_that_shifts_all_targets_is_the_maximum_of_its_likelihood(
    rows,
):
    """In closed form: the mean of two targets along the joint has the variance
    2 s^2 + sigma^2, and every other direction has the variance sigma^2."""
    model, estimate = make_gantry(targets=2, rows=rows)
    rng = np.random.default_rng(23)
    contrasts = SENSOR_M * rng.standard_normal((40, 2, 3))
    contrasts[..., 0] += 80e-6 * rng.standard_normal((40, 1))
    rotation_contrasts = SENSOR_RAD * rng.standard_normal((40, 2, 3))
    rotation_errors = make_symmetric_repeats(rotation_contrasts) if rows == 6 else None
    noise = estimate_noise_from_repeats(
        model,
        estimate,
        measure_with_errors(model, make_symmetric_repeats(contrasts), rotation_errors),
    )
    along_joint = (contrasts[..., 0].sum(axis=1) ** 2).sum() / 2
    variance = ((contrasts**2).sum() - along_joint) / (40 * 5)
    rotation_variance = (rotation_contrasts**2).mean() if rows == 6 else variance
    assert noise.position_m == pytest.approx(np.sqrt(variance), rel=1e-3)
    assert noise.orientation_rad == pytest.approx(np.sqrt(rotation_variance), rel=1e-3)
    # Both targets measure the same forty draws of the joint error.
    assert noise.joint_rad[0] == pytest.approx(
        np.sqrt((along_joint / 40 - variance) / 2) * compute_safety_factor(40), rel=1e-3
    )


@pytest.mark.parametrize("joints", [1, 2, 3])
def test_joint_noise_is_used_if_it_raises_the_log_likelihood_by_more_than_one_a_joint(
    joints,
):
    """Akaike's criterion, at contrasts whose gain over the sensor noise alone is known
    exactly."""
    names = [f"Tx(q{number})" for number in range(1, joints + 1)]
    model, estimate = make_gantry(" ".join(names) + " [hand]")
    poses = 40

    def compute_gain(ratio):
        return 0.5 * poses * (3 * np.log((ratio**2 + 2) / 3) - np.log(ratio**2))

    for margin, is_used in ((-0.05, False), (0.05, True)):
        ratio = brentq(
            lambda ratio, margin=margin: compute_gain(ratio) - joints - margin,
            1.0,
            10.0,
        )
        contrasts = SENSOR_M * np.array([ratio, 1.0, 1.0]) * np.ones((poses, 1, 3))
        noise = estimate_noise_from_repeats(
            model,
            estimate,
            measure_with_errors(model, make_symmetric_repeats(contrasts)),
        )
        assert noise.joint_rad.any() == is_used, ratio


def test_a_sample_of_many_contrasts_is_spread_over_the_campaign(
    monkeypatch,
):
    """The second half of the campaign is three times as noisy; a sample of a half of
    the states contains as much of either half."""
    model, estimate = make_gantry()
    contrasts = (
        SENSOR_M * np.repeat([1.0, 3.0], 20)[:, None, None] * np.ones((40, 1, 3))
    )
    measurements = measure_with_errors(model, make_symmetric_repeats(contrasts))
    for limit, freedom in ((120, 120), (60, 60)):
        monkeypatch.setattr(noise_module, "MAX_CONTRASTS", limit)
        noise = estimate_noise_from_repeats(model, estimate, measurements)
        assert noise.degrees_of_freedom == freedom
        assert noise.position_m == pytest.approx(np.sqrt(5) * SENSOR_M, rel=1e-6)


@pytest.mark.parametrize("column", ["approach", "load", "session"])
def test_measurements_that_differ_in_side_load_or_session_are_no_repeats(column):
    """A difference between two directions of approach, loads or sessions is no noise,
    however large it is."""
    model, estimate = make_gantry()
    estimate = replace(
        estimate,
        sessions=(0, 1),
        frame_rotation=np.tile(np.eye(3), (2, 1, 1)),
        frame_position=np.zeros((2, 3)),
    )
    contrasts = SENSOR_M * np.random.default_rng(25).standard_normal((5, 2, 1, 3))
    # Of the four measurements of a pose, the first two and the last two are repeats.
    errors = np.concatenate(
        [
            make_symmetric_repeats(contrasts[:, 0]),
            1e-3 + make_symmetric_repeats(contrasts[:, 1]),
        ],
        axis=1,
    )
    measurements = measure_with_errors(model, errors)
    later = measurements.repeat // 2
    values = {"approach": 2.0 * later[:, None] - 1.0, "load": later, "session": later}
    noise = estimate_noise_from_repeats(
        model, estimate, replace(measurements, **{column: values[column]})
    )
    assert noise.degrees_of_freedom == 30
    assert noise.position_m == pytest.approx(np.sqrt((contrasts**2).mean()), rel=1e-6)


@pytest.mark.parametrize("rows", [3, 6])
@pytest.mark.parametrize("end", [0, 1])
def test_declared_noise_is_doubted_outside_the_range_of_99_in_100_campaigns(
    fanuc, rows, end
):
    """The range lies between the 0.5 and 99.5 % quantiles of a standard deviation from
    so many contrasts of positions."""
    model, estimate = make_gantry(rows=rows)
    errors = make_symmetric_repeats(SENSOR_M * np.ones((12, 1, 3)))
    measurements = measure_with_errors(model, errors, errors if rows == 6 else None)
    limit = np.sqrt(chi2.ppf([0.005, 0.995][end], 36) / 36)
    for share, warns in ((0.999, end == 0), (1.001, end == 1)):
        campaign = replace(
            declare_campaign(fanuc, position_m=SENSOR_M / (share * limit)),
            measurements=measurements,
        )
        assert len(choose_noise(campaign, model, estimate)[1]) == warns


@pytest.mark.parametrize("joint_rad", [5e-6, 2e-5])
def test_joint_noise_below_the_sensor_noise_is_estimated_if_all_joints_repeat_alike(
    fanuc, joint_rad
):
    """At 2 m the joints contribute a tenth to four tenths of the sensor noise. The mean
    over six campaigns is right within a third."""
    estimates = np.array(
        [
            estimate_joint_repeatability(
                *simulate_repeats(fanuc, seed, joint_rad=joint_rad)
            )
            for seed in range(6)
        ]
    )
    assert np.sqrt((estimates[:, 0] ** 2).mean()) == pytest.approx(joint_rad, rel=0.35)
    assert (estimates[:, 1] > 1.0).all()


def test_without_repeats_the_joint_repeatability_is_unknown(fanuc):
    measured_once = simulate_repeats(fanuc, 1, poses=2, repeats=1)
    assert estimate_joint_repeatability(*measured_once) == (0.0, 0.0)


def test_noise_is_read_back_from_its_document():
    noise = Noise("repeats", 1e-5, 2e-5, np.array([1e-6, 0, 3e-6]), 77, 2e-6)
    parsed = parse_noise({"noise": serialize_noise(noise), "warnings": []})
    np.testing.assert_array_equal(parsed.joint_rad, noise.joint_rad)
    assert replace(parsed, joint_rad=None) == replace(noise, joint_rad=None)


def test_noise_is_read_back_from_a_verdict():
    noise = Noise("declared", 1e-5, 2e-5, np.array([1e-6, 0, 3e-6]), 77, 2e-6)
    restored = get_noise(_state_noise(noise, noise.pose_rad, 1.0))
    assert serialize_noise(restored) == serialize_noise(noise)


JOINTS = (2, 3, 4, 5)


def plant_joint_offsets(robot, offset, **options):
    """Make a campaign of a robot whose joints 2 to 5 have an offset of alternating
    sign, and a model that declares these offsets."""
    keys = [f"joint_offset@{joint}" for joint in JOINTS]
    campaign = planted(
        robot,
        {key: [offset * (-1) ** number] for number, key in enumerate(keys)},
        seed=2,
        **options,
    )
    model = campaign.declared.model.with_effects(
        [campaign.candidates[key] for key in keys]
    )
    return campaign, model


def fit_with_wide_prior(campaign, model, share=1.0):
    """Fit with the widest prior and a share of the true noise."""
    return fit_model(
        set_prior_scale(model, PRIOR_SCALES[-1]),
        campaign.observations,
        campaign.declared.noise.scaled(share),
    )


@pytest.mark.parametrize(("offset", "scale"), [(1e-4, 0.1), (1e-3, 1.0), (1e-2, 10.0)])
def test_the_prior_of_the_declared_geometry_has_the_scale_of_the_largest_evidence(
    offset, scale, kuka
):
    campaign, model = plant_joint_offsets(kuka, offset)
    # The prior of joint compliances is their own.
    assert find_declared_geometry(model) == {"joint_offset"}
    wide = fit_with_wide_prior(campaign, model)
    assert maximize_evidence(wide)[0] == pytest.approx(scale, rel=0.01)
    fit = fit_declared_model(model, campaign.observations, campaign.declared.noise)
    priors = {owner: parameter.prior_std for owner, parameter in fit.parameters}
    assert [priors[f"joint_offset@{joint}"] for joint in JOINTS] == pytest.approx(
        [scale * 1e-3] * 4, rel=0.01
    )
    assert priors["joint_compliance"] == model.effects[0].parameters[-1].prior_std


def test_contacts_with_wavy_planes_do_not_make_the_robot_smaller(tmp_path):
    """Planes are wavy by ten times the declared noise, and contain no length: a smaller
    robot would touch them more exactly."""
    workshop = open_workshop(3, offsets=np.zeros(6))
    rows, features = touch_crossing_planes(workshop, 25, 5e-4)
    document = {
        "measured": "plane",
        "features": features,
        "declared": ["joint_offset", "link_geometry"],
        "noise": {"position_m": 5e-5},
    }
    case = build_contact_case(write_contacts(tmp_path / "cell", document, rows))
    assert find_widest_scale(case.model, case.observations) == 1.0
    noise, _ = estimate_noise(case)
    fit = fit_declared_model(case.model, case.observations, noise)
    values = get_parameter_values(fit.model, fit.estimate)
    lengths = [
        value / parameter.plausible
        for value, (owner, parameter) in zip(values, fit.parameters, strict=True)
        if owner.startswith("link_geometry") and parameter.unit == "m"
    ]
    assert np.abs(lengths).max() < 4.0
    assert not find_misplaced_frames(fit, case.campaign)


def test_sockets_at_unknown_places_do_not_widen_the_prior_of_lengths(tmp_path):
    workshop = open_workshop(3)
    (place,) = spread_places(workshop, 1)
    rows = [
        {"angles": seat_in_socket(workshop, place, 1e-4), "feature": "socket"}
        for _ in range(20)
    ]
    for keys, widest in (({}, 1.0), ({"position_m": place.tolist()}, PRIOR_SCALES[-1])):
        document = {"measured": "point", "features": {"socket": keys}}
        folder = write_contacts(tmp_path / f"{widest}", document, rows)
        case = build_contact_case(folder)
        assert find_widest_scale(case.model, case.observations) == widest


def test_normals_that_are_known_take_no_degrees_of_freedom_from_the_noise(tmp_path):
    """A normal is known far better than three touches of a small patch show it."""
    workshop = open_workshop(5)
    rows, features = [], {}
    for patch in range(60):
        normal = np.eye(3)[patch % 3]
        place = workshop.find_tool(workshop.joint_limits.mean(axis=1))[0]
        place += 1e-3 * patch
        name = f"patch{patch}"
        features[name] = {"normal": normal.tolist(), "normal_std_rad": 1e-6}
        for _ in range(3):
            angles = touch_surface(workshop, place, normal, FLAT, SENSOR_M)
            rows.append({"angles": angles, "feature": name})
    document = {"measured": "plane", "features": features}
    case = build_contact_case(write_contacts(tmp_path / "cell", document, rows))
    noise, _ = estimate_noise(case)
    # 144 touches are fitted, less 60 heights, 3 coordinates of the tool and 4 offsets of
    # joints: the estimate is 1 +- 0.08 times the noise.
    assert noise.position_m == pytest.approx(SENSOR_M, rel=0.3)


@pytest.mark.parametrize("share", [1.0, 0.1, 0.01])
def test_the_prior_scale_does_not_depend_on_the_assumed_noise(share, kuka):
    """A declared noise that is far too small must not make the prior scale small: the
    scale is a length or an angle, not a number of standard errors. The true noise is
    estimated with it."""
    campaign, model = plant_joint_offsets(kuka, 1e-3)
    scale, noise_factor = maximize_evidence(fit_with_wide_prior(campaign, model, share))
    assert scale == pytest.approx(1.0, rel=0.01)
    assert noise_factor == pytest.approx(1.0 / share, rel=0.15)


def test_the_number_of_effective_parameters_is_the_trace_of_the_hat_matrix(kuka):
    campaign, model = plant_joint_offsets(kuka, 1e-4, poses=6)
    fit = fit_model(
        set_prior_scale(model, 0.1),
        campaign.observations,
        campaign.declared.noise.scaled(30.0),
    )
    rows = np.concatenate(
        [
            white.reshape(-1, len(fit.unidentifiable))
            for _, _, white in fit.iterate_sensitivities(campaign.observations)
        ]
    )
    assert count_effective_parameters(fit) == pytest.approx(
        np.trace(rows @ fit.covariance @ rows.T), rel=1e-3
    )
    assert count_effective_parameters(fit) < (~fit.unidentifiable).sum() - 0.5


def build_case_with_errors(robot, position_errors, rotation_errors, *, oriented):
    """Build a case of a known robot with nothing to fit, whose measurements have these
    errors, (M, 3) in m and rad."""
    plan = Plan(poses=8, loads=1, repeats=1, noise=0.0, force=0.0, oriented=oriented)
    campaign = replace(make_campaign(robot, 3, plan), compliance="nominal", noise=None)
    measurements = campaign.measurements
    measurements = replace(
        measurements, position=measurements.position + position_errors
    )
    if oriented:
        errors = Rotation.from_rotvec(rotation_errors)
        rotation = errors * Rotation.from_rotvec(measurements.rotation_vector)
        measurements = replace(measurements, rotation_vector=rotation.as_rotvec())
    campaign = replace(campaign, measurements=measurements)
    return Case(
        campaign, average_repeats(measurements), build_declared_model(campaign), {}
    )


def draw_errors(seed, size):
    """Draw an error for each measurement of eight poses, two loads and four targets."""
    return size * np.random.default_rng(seed).standard_normal((8 * 2 * 4, 3))


@pytest.mark.parametrize("oriented", [False, True])
def test_without_repeats_or_declaration_noise_is_the_root_mean_square_of_the_residual(
    fanuc, oriented
):
    position_errors = draw_errors(1, 70e-6)
    rotation_errors = draw_errors(2, 20e-6)
    noise, warnings = estimate_noise(
        build_case_with_errors(
            fanuc, position_errors, rotation_errors, oriented=oriented
        )
    )
    assert noise.source == "residual"
    assert noise.degrees_of_freedom == 0
    assert noise.pose_rad == 0.0
    assert noise.position_m == pytest.approx(
        np.sqrt((position_errors**2).mean()), rel=1e-6
    )
    # Without measured orientations their noise is, as in a declaration, as many radians
    # as the position noise is metres.
    expected = rotation_errors if oriented else position_errors
    assert noise.orientation_rad == pytest.approx(
        np.sqrt((expected**2).mean()), rel=1e-6
    )
    np.testing.assert_array_equal(noise.joint_rad, np.zeros(6))
    assert len(warnings) == 1
    assert "no repeats and no declared noise" in warnings[0]


@pytest.mark.parametrize("offset_std_m", [0.0, 2e-4])
def test_the_tool_is_known_no_better_than_the_reflectors_on_it(kuka, offset_std_m):
    scale = 0.1
    sites = build_sites(kuka)
    links = declared_candidates(["link_geometry"], sites)
    target = Target("A", "6DoF", (0.1, 0.0, 0.0), offset_std_m=offset_std_m)
    model = set_prior_scale(make_model(kuka, (target,), effects=links), scale)
    for effect in model.effects:
        usual = np.array([scale * p.plausible for p in effect.parameters])
        is_tool = effect.joints == (kuka.joints,)
        added = offset_std_m * np.array([p.unit == "m" for p in effect.parameters])
        expected = np.hypot(usual, added * is_tool)
        np.testing.assert_allclose(
            [p.prior_std for p in effect.parameters], expected, rtol=1e-12
        )
