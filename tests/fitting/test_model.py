"""The model that a campaign declares, its parameters in one vector, and its
predictions."""

from dataclasses import replace

import numpy as np
import pytest
from fitted_models import build_model
from made_campaigns import POINTS, Plan, make_campaign, make_plan
from scipy.optimize import root
from support import OTHER_CHAINS, chain_of
from synthetic import (
    make_estimate,
    make_measurements,
    make_model,
    make_states,
    observe_exactly,
)

from elastocal.campaigns.campaign import Campaign, Target, tabulate_measurements
from elastocal.effects.catalogue import candidates_on
from elastocal.effects.protocol import Parameter
from elastocal.fitting.cases import build_case
from elastocal.fitting.least_squares import fit_model
from elastocal.fitting.model import (
    apply_step,
    build_declared_model,
    build_nominal_model,
    compute_residuals,
    evaluate_conditions,
    find_nonlinear_parameters,
    get_parameter_bounds,
    get_parameter_values,
    list_parameters,
    predict,
)
from elastocal.fitting.noise import Noise
from elastocal.fitting.observations import separate_measurements
from elastocal.io.documents import read_document
from elastocal.mechanics.elastostatics import (
    compute_exact_deflections,
    compute_joint_torques,
)
from elastocal.mechanics.kinematics import compute_poses

NOISE = Noise("declared", 6e-5, 6e-5, np.zeros(6))
TWO_TARGETS = Target("A", "6DoF", None), Target("B", "3DoF", (0.1, 0.0, -0.2))


@pytest.fixture(scope="module")
def campaign(kuka):
    return make_campaign(kuka, 1, Plan(poses=5, loads=1, repeats=4, tracker=True))


def describe_case(campaign, config_folder, **changes):
    """Return the document that step 1 of the pipeline writes of the campaign."""
    document = {
        "campaign": "cell7",
        "robot": "kuka",
        "measured": "pose" if campaign.measures_poses else "position",
        "frame": campaign.frame,
        "targets": {
            f"T{name}": {"point": name, "offset_m": "unknown"} for name in POINTS
        },
    }
    return {
        "source": "cell7/campaign.yaml",
        "campaign": document | changes,
        "robot": read_document(config_folder / "robots" / "kuka.yaml"),
    }


def build_case_of(campaign, config_folder, **changes):
    """Build the case of a campaign whose document has some changes."""
    return build_case(
        describe_case(campaign, config_folder, **changes),
        tabulate_measurements(campaign.measurements),
    )


def test_a_model_of_rigid_joints_states_that_compliances_are_unknown(
    campaign, config_folder
):
    document = describe_case(campaign, config_folder)
    del document["robot"]["compliance_urad_per_Nm"]
    document["robot"]["masses"] = [
        {"link": 2, "mass_kg": 10, "centre_m": [0.3, 0, 0], "relative_std": 0.2}
    ]
    rigid = build_case(document, tabulate_measurements(campaign.measurements)).model
    assert not rigid.compliance_known
    assert not rigid.nominal_compliance.any()
    assert not rigid.sites.masses
    document["campaign"]["compliance"] = "identify"
    elastic = build_case(document, tabulate_measurements(campaign.measurements)).model
    assert not elastic.compliance_known
    assert (elastic.nominal_compliance > 0).all()
    assert elastic.sites.masses


def test_before_is_the_error_of_the_rigid_robot_if_the_file_has_masses_and_no_springs(
    kuka, config_folder
):
    """Distances of the measurements from the file's kinematics are the true errors,
    because the campaign declares the base and the targets."""
    campaign = make_campaign(kuka, 1, Plan(poses=5, loads=1, oriented=False))
    targets = {f"T{name}": {"point": name, "offset_m": [0, 0, 0]} for name in POINTS}
    document = describe_case(
        campaign, config_folder, compliance="identify", targets=targets
    )
    del document["robot"]["compliance_urad_per_Nm"]
    document["robot"]["masses"] = [
        {"link": 2, "mass_kg": 400, "centre_m": [0.5, 0, 0], "relative_std": 0.2}
    ]
    measured = campaign.measurements
    case = build_case(document, tabulate_measurements(measured))
    observations = separate_measurements(measured)
    fitted = fit_model(build_nominal_model(case.model), observations, NOISE)
    expected = np.empty_like(measured.position)
    for number, name in enumerate(POINTS):
        rows = measured.target == number
        point = kuka.chain.point(name)
        expected[rows] = compute_poses(kuka.chain, measured.joint_angles[rows], point)[
            0
        ]
    np.testing.assert_allclose(
        fitted.residual, measured.position - expected, rtol=0, atol=1e-12
    )
    sagging = fit_model(replace(case.model, effects=()), observations, NOISE)
    assert np.abs(sagging.residual - fitted.residual).max() > 1e-4


@pytest.mark.parametrize(
    ("compliance", "load_effects"),
    [
        ("identify", {"joint_compliance", "declared_application_point"}),
        ("nominal", {"declared_application_point"}),
    ],
)
def test_the_model_has_the_declared_effects_and_the_candidates_are_all_others(
    campaign, config_folder, compliance, load_effects
):
    case = build_case_of(
        campaign,
        config_folder,
        compliance=compliance,
        declared=["joint_offset", "hysteresis"],
    )
    declared = case.model.effects
    assert {effect.effect for effect in declared} == {
        *load_effects,
        "hysteresis",
        "joint_offset",
    }
    offsets = [effect.key for effect in declared if effect.effect == "joint_offset"]
    assert offsets == [f"joint_offset@{joint}" for joint in range(1, 7)]
    candidate_effects = {candidate.effect for candidate in case.candidates.values()}
    assert not candidate_effects & {"joint_offset", "hysteresis"}
    assert {"lost_motion", "link_weight", "frame_drift"} <= candidate_effects
    assert all(key == candidate.key for key, candidate in case.candidates.items())
    undeclared = build_case_of(campaign, config_folder)
    additional = set(undeclared.candidates) - set(case.candidates)
    assert additional >= {
        effect.key for effect in declared if effect.effect not in load_effects
    }
    assert {key.split("@")[0] for key in additional} == {"joint_offset", "hysteresis"}


@pytest.mark.parametrize(("measured", "rows"), [("position", 3), ("pose", 6)])
@pytest.mark.parametrize(("frame", "fitted"), [("tracker", True), ("base", False)])
@pytest.mark.parametrize("compliance", ["nominal", "identify"])
def test_the_declared_model_follows_the_campaign(
    fanuc, measured, rows, frame, fitted, compliance
):
    rigid = make_model(fanuc.chain, (Target("A", "6DoF", (0, 0, 0)),))
    measurements = make_measurements(rigid, np.random.default_rng(0), 2, 1, 0.0, 0.0)
    measurements = replace(
        measurements, time_s=np.array([7.0, 5.0]), row=np.array([4, 9])
    )
    campaign = Campaign(
        "c",
        fanuc,
        make_plan(measured),
        frame,
        TWO_TARGETS,
        compliance,
        (),
        None,
        {},
        measurements,
    )
    offset = candidates_on(make_model(fanuc.chain).sites)["joint_offset@2"]
    model = build_declared_model(campaign, (offset,))
    assert (model.rows, model.fitted_frames, model.targets) == (
        rows,
        fitted,
        TWO_TARGETS,
    )
    assert model.identifies_compliance == (compliance == "identify")
    assert [effect.key for effect in model.effects][-1] == "joint_offset@2"
    np.testing.assert_array_equal(model.nominal_compliance, fanuc.compliance)
    assert model.time_zero_s == 5.0 and model.row_span == (4, 9)


def test_parameters_are_named_in_the_order_of_the_sensitivities(full_case):
    model, estimate, _ = full_case
    owners = [owner for owner, _ in list_parameters(model, estimate)]
    assert owners == [
        *["frame 0"] * 6,
        *["frame 4"] * 6,
        *["target A"] * model.rows,
        *["target C"] * model.rows,
        *["joint_compliance"] * 6,
        *["lost_motion@2"] * 2,
        *["link_geometry@3"] * 6,
    ]
    names = [parameter.name for _, parameter in list_parameters(model, estimate)]
    assert names[:6] == ["dx", "dy", "dz", "rx", "ry", "rz"]
    assert names[-8:-6] == ["half_play", "torque"]


@pytest.mark.parametrize(
    ("rows", "expected"),
    [
        (
            6,
            [
                "turn rx",
                "turn ry",
                "turn rz",
                "place dx",
                "place dy",
                "place dz",
                "both dx",
                "both dy",
                "both dz",
                "both rx",
                "both ry",
                "both rz",
            ],
        ),
        (
            3,
            ["place dx", "place dy", "place dz", "both dx", "both dy", "both dz"],
        ),
    ],
    ids=["poses", "positions"],
)
def test_only_unknown_quantities_of_a_target_are_parameters(fanuc, rows, expected):
    targets = [
        Target("turn", "6DoF", (0.0, 0.0, 0.1), None),
        Target("place", "6DoF", None, (0.0, 0.0, 1.5)),
        Target("known", "6DoF", (0.0, 0.0, 0.1), (1.0, 0.0, 0.0)),
        Target("both", "6DoF", None),
    ]
    model = make_model(fanuc.chain, targets, rows=rows, fitted_frames=False)
    estimate = make_estimate(model, seed=3)
    assert [
        f"{owner.removeprefix('target ')} {parameter.name}"
        for owner, parameter in list_parameters(model, estimate)
    ] == expected
    stepped = apply_step(model, estimate, np.full(len(expected), 1e-3))
    shift = np.abs(stepped.target_offset - estimate.target_offset).max(axis=1)
    assert (shift > 0).tolist() == [False, True, False, True]
    rotation_change = np.abs(stepped.target_rotation - estimate.target_rotation)
    is_rotated = rotation_change.max(axis=(1, 2)) > 1e-4
    assert is_rotated.tolist() == [rows == 6, False, False, rows == 6]


def find_parameter(model, estimate, key, name):
    """Return the index of one parameter of an effect."""
    names = [
        (owner, parameter.name) for owner, parameter in list_parameters(model, estimate)
    ]
    assert names.count((key, name)) == 1
    return names.index((key, name))


def test_shapes_have_ranges_and_other_parameters_the_signs_of_physics(fanuc):
    """Two of the three effects have a shape parameter of the same name."""
    model = build_model(fanuc, "lost_motion@2", "link_geometry@3", "stiffening@4")
    estimate = make_estimate(model, seed=7)
    bounds = get_parameter_bounds(model, estimate)
    expected = np.tile([-np.inf, np.inf], (len(list_parameters(model, estimate)), 1))
    for effect in (model.effects[0], model.effects[2]):
        index = find_parameter(model, estimate, effect.key, "torque")
        expected[index] = effect.shapes[0].lowest, effect.shapes[0].highest
    is_nonlinear = np.isfinite(expected[:, 0])
    owners = [owner for owner, _ in list_parameters(model, estimate)]
    # A play is positive; stiffening takes away from a compliance.
    expected[owners.index("lost_motion@2"), 0] = 0.0
    expected[owners.index("stiffening@4"), 1] = 0.0
    np.testing.assert_array_equal(bounds, expected)
    np.testing.assert_array_equal(
        find_nonlinear_parameters(model, estimate), is_nonlinear
    )
    assert is_nonlinear.sum() == 2


@pytest.mark.parametrize(
    ("sign", "lowest", "bounds"),
    [(1, -3.0, (0.0, np.inf)), (-1, -3.0, (-3.0, 0.0)), (0, -3.0, (-3.0, np.inf))],
)
def test_the_bounds_of_a_parameter_are_its_sign_and_its_lowest_value(
    sign, lowest, bounds
):
    parameter = Parameter("p", "kg", 1.0, sign=sign, lowest=lowest)
    assert parameter.bounds == bounds


def solve_equilibrium(chain, compliance, states):
    """Solve by scipy's root finder for the rotation of each joint under the torque that
    the load has at the deflected pose: ndarray (S, joints)."""
    end_effector = replace(chain.end_effector, offset_m=(0, 0, 0))

    def compute_imbalance(deflection, joint_angles, wrench):
        torque = compute_joint_torques(
            chain, joint_angles + deflection, wrench, end_effector
        )
        return deflection - compliance * torque

    deflections = []
    for joint_angles, wrench in zip(states.joint_angles, states.wrench, strict=True):
        start = np.zeros(len(joint_angles))
        solution = root(compute_imbalance, start, (joint_angles, wrench), tol=1e-15)
        deflections.append(solution.x)
    return np.array(deflections)


def test_nominal_compliances_deflect_the_robot_as_equation_9_with_exact_kinematics(
    fanuc,
):
    targets = tuple(
        Target(point.name, point.name, (0.05, 0.1, -0.1))
        for point in fanuc.chain.points
    )
    model = make_model(
        fanuc.chain, targets, 6, fitted_frames=False, compliance=fanuc.compliance
    )
    estimate = make_estimate(model)
    states = make_states(6, 6, seed=4)
    observations = observe_exactly(model, estimate, states)
    position, rotation = predict(
        model, estimate, observations, evaluate_conditions(model, estimate, states)
    )
    deflection = solve_equilibrium(fanuc.chain, fanuc.compliance, states)
    for index, point in enumerate(fanuc.chain.points):
        target = replace(point, offset_m=(0.05, 0.1, -0.1))
        expected = compute_poses(fanuc.chain, states.joint_angles + deflection, target)
        of_target = observations.target == index
        np.testing.assert_allclose(position[of_target], expected[0], rtol=0, atol=1e-9)
        np.testing.assert_allclose(rotation[of_target], expected[1], rtol=0, atol=1e-9)
    displacement = compute_exact_deflections(
        fanuc.chain, states.joint_angles, deflection, fanuc.chain.end_effector
    )
    assert np.abs(displacement).max() > 1e-4


@pytest.mark.parametrize("name", OTHER_CHAINS)
def test_effects_at_zero_leave_the_predictions_of_the_declared_model(name):
    chain = chain_of(OTHER_CHAINS[name])
    declared = make_model(chain, rows=6)
    estimate = make_estimate(declared, seed=8)
    states = make_states(chain.coordinates, 4, seed=9)
    observations = observe_exactly(declared, estimate, states)
    effects = tuple(candidates_on(declared.sites).values())
    model = declared.with_effects(effects)
    with_zeros = estimate.with_effects(effects)
    conditions = evaluate_conditions(model, with_zeros, states)
    np.testing.assert_allclose(
        compute_residuals(model, with_zeros, observations, conditions), 0.0, atol=1e-14
    )


def test_a_declared_offset_is_a_parameter_about_its_declared_value(kuka, campaign):
    """Its steps, values and priors count from what is declared; an exact one is none."""
    model = build_declared_model(campaign)
    inexact = Target("B", "6DoF", (0.1, 0.0, -0.2), offset_std_m=2e-4)
    exact = Target("C", "6DoF", (0.0, 0.1, 0.0))
    model = replace(model, targets=(TWO_TARGETS[0], inexact, exact), rows=3)
    estimate = make_estimate(model)
    offset = estimate.target_offset.copy()
    offset[1] = inexact.offset_m
    estimate = replace(estimate, target_offset=offset)
    parameters = list_parameters(model, estimate)
    owned = [
        (owner, parameter.prior_std)
        for owner, parameter in parameters
        if owner.startswith("target ")
    ]
    assert owned == [("target A", None)] * 3 + [("target B", 2e-4)] * 3
    index = [owner for owner, _ in parameters].index("target B")
    step = np.zeros(len(parameters))
    step[index : index + 3] = 1e-4, -2e-4, 3e-4
    moved = apply_step(model, estimate, step)
    np.testing.assert_allclose(
        get_parameter_values(model, moved)[index : index + 3],
        step[index : index + 3],
        atol=1e-15,
    )
    np.testing.assert_allclose(
        moved.target_offset[1], np.add(inexact.offset_m, [1e-4, -2e-4, 3e-4])
    )
    assert model.has_unknown_targets
    assert build_nominal_model(model).targets[1].offset_std_m == 0.0


def test_a_declared_base_is_a_parameter_of_each_session_about_its_declared_value(
    kuka, campaign
):
    """Its steps, values and priors count from what is declared; an exact one is none."""
    exact = replace(build_declared_model(campaign), fitted_frames=False)
    model = build_declared_model(replace(campaign, frame="base", base_std_m=2e-4))
    assert "declared_base" in [effect.effect for effect in model.effects]
    estimate = make_estimate(model, sessions=(0, 3))
    parameters = list_parameters(model, estimate)
    frames = [
        (owner, parameter.prior_std)
        for owner, parameter in parameters
        if owner.startswith("frame ")
    ]
    assert frames == [("frame 0", 2e-4)] * 6 + [("frame 3", 2e-4)] * 6
    step = np.zeros(len(parameters))
    step[6:12] = 1e-4, -2e-4, 3e-4, 2e-4, 1e-4, -1e-4
    moved = apply_step(model, estimate, step)
    np.testing.assert_allclose(
        get_parameter_values(model, moved)[:12], step[:12], atol=1e-15
    )
    np.testing.assert_allclose(moved.frame_position[1], step[6:9])
    for without in (exact, build_nominal_model(model)):
        owners = [owner for owner, _ in list_parameters(without, estimate)]
        assert not any(owner.startswith("frame ") for owner in owners)


@pytest.mark.parametrize(
    ("std_m", "compliance", "force", "expected"),
    [
        (1e-3, "identify", 500.0, [1e-3] * 3),
        (0.0, "identify", 500.0, []),
        (1e-3, "identify", 0.0, []),
        (1e-3, "nominal", 500.0, []),
    ],
)
def test_loads_on_springs_act_at_a_point_that_is_known_as_well_as_declared(
    kuka, std_m, compliance, force, expected
):
    """The robot is rigid if its compliances are nominal."""
    rigid = replace(kuka, compliance=np.zeros(6))
    measurements = make_measurements(
        make_model(kuka.chain, (Target("A", "6DoF", (0, 0, 0)),)),
        np.random.default_rng(0),
        2,
        1,
        0.0,
        0.0,
    )
    wrench = np.full_like(measurements.wrench, force)
    campaign = Campaign(
        "c",
        rigid,
        make_plan("position"),
        "base",
        TWO_TARGETS,
        compliance,
        (),
        None,
        {},
        replace(measurements, wrench=wrench),
        application_point_std_m=std_m,
    )
    deviations = [
        parameter.prior_std
        for effect in build_declared_model(campaign).effects
        if effect.effect == "declared_application_point"
        for parameter in effect.parameters
    ]
    assert deviations == expected
