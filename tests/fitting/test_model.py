"""The model that a campaign declares, its parameters in one vector, and what it predicts."""

from dataclasses import replace

import numpy as np
import pytest
from fitted_models import model_of
from made_campaigns import POINTS, Plan, made
from scipy.optimize import root
from support import OTHER_CHAINS, chain_of, robot_of
from synthetic import made_estimate, made_measurements, made_model, made_states, seen_exactly

from elastocal.campaigns.campaign import Campaign, Target
from elastocal.campaigns.columns import columns_of
from elastocal.effects.catalogue import candidates_on
from elastocal.fitting.model import (
    case_from,
    conditions,
    declared_model,
    displaced_coordinates,
    limits,
    nonlinear_parameters,
    parameter_values,
    parameters,
    predict,
    residuals,
    stepped,
)
from elastocal.io.documents import read_document
from elastocal.mechanics.elastostatics import exact_deflections, joint_torques
from elastocal.mechanics.kinematics import poses
from elastocal.mechanics.robot import Mass

TWO = Target("A", "6DoF", None), Target("B", "3DoF", (0.1, 0.0, -0.2))


@pytest.fixture(scope="module")
def campaign(kuka):
    return made(kuka, 1, Plan(poses=5, loads=1, repeats=4, tracker=True))


def described(campaign, config_folder, **changes):
    """What step 1 writes of the campaign."""
    document = {
        "campaign": "cell7",
        "robot": "kuka",
        "measured": campaign.measured,
        "frame": campaign.frame,
        "targets": {f"T{name}": {"point": name, "offset_m": "unknown"} for name in POINTS},
    }
    robot = read_document(config_folder / "robots" / "kuka.yaml")
    return {"source": "cell7/campaign.yaml", "campaign": document | changes, "robot": robot}


def case_of(campaign, config_folder, **changes):
    return case_from(described(campaign, config_folder, **changes), columns_of(campaign.measurements))


def test_the_campaign_is_the_one_described(campaign, config_folder, kuka):
    changes = {"noise": {"position_m": 1e-5}, "holdout": {"fraction": 0.2, "seed": 4}, "declared": ["hysteresis"]}
    found = case_of(campaign, config_folder, compliance="identify", **changes).campaign
    assert (found.name, found.measured, found.frame, found.compliance) == ("cell7", "pose", "tracker", "identify")
    assert (found.declared, found.noise, found.holdout) == (("hysteresis",), changes["noise"], changes["holdout"])
    assert [(target.name, target.point, target.offset_m) for target in found.targets] == [(f"T{n}", n, None) for n in POINTS]
    assert found.robot.chain == kuka.chain
    for name, values in vars(campaign.measurements).items():
        if values is None:
            assert getattr(found.measurements, name) is None, name
        else:
            np.testing.assert_array_equal(getattr(found.measurements, name), values, err_msg=name)


def test_a_model_of_rigid_joints_knows_that_no_compliances_are_known(campaign, config_folder):
    described_ = described(campaign, config_folder)
    del described_["robot"]["compliance_urad_per_Nm"]
    described_["robot"]["masses"] = [{"link": 2, "mass_kg": 10, "centre_m": [0.3, 0, 0], "relative_std": 0.2}]
    case = case_from(described_, columns_of(campaign.measurements))
    assert not case.model.compliance_known and not case.model.nominal_compliance.any() and not case.model.sites.masses
    described_["campaign"]["compliance"] = "identify"
    case = case_from(described_, columns_of(campaign.measurements))
    assert not case.model.compliance_known and (case.model.nominal_compliance > 0).all() and case.model.sites.masses


@pytest.mark.parametrize(("compliance", "springs"), [("identify", ["joint_compliance"]), ("nominal", [])])
def test_the_model_has_the_declared_effects_and_the_candidates_are_all_others(campaign, config_folder, compliance, springs):
    case = case_of(campaign, config_folder, compliance=compliance, declared=["joint_offset", "hysteresis"])
    found = {effect.effect for effect in case.model.effects}
    assert found == {*springs, "hysteresis", "joint_offset"}
    assert [e.key for e in case.model.effects if e.effect == "joint_offset"] == [f"joint_offset@{j}" for j in range(1, 7)]
    missing = {candidate.effect for candidate in case.candidates.values()}
    assert not missing & {"joint_offset", "hysteresis"} and {"lost_motion", "link_weight", "frame_drift"} <= missing
    assert all(key == candidate.key for key, candidate in case.candidates.items())
    more = set(case_of(campaign, config_folder).candidates) - set(case.candidates)
    assert more >= {e.key for e in case.model.effects if e.effect not in springs}
    assert {key.split("@")[0] for key in more} == {"joint_offset", "hysteresis"}


@pytest.mark.parametrize(("measured", "rows"), [("position", 3), ("pose", 6)])
@pytest.mark.parametrize(("frame", "fitted"), [("tracker", True), ("base", False)])
@pytest.mark.parametrize("compliance", ["nominal", "identify"])
def test_declared_model_is_that_of_the_campaign(fanuc, measured, rows, frame, fitted, compliance):
    bare = made_model(fanuc.chain, (Target("A", "6DoF", (0, 0, 0)),))
    measurements = made_measurements(bare, np.random.default_rng(0), 2, 1, 0.0, 0.0)
    measurements = replace(measurements, time_s=np.array([7.0, 5.0]), row=np.array([4, 9]))
    campaign = Campaign("c", fanuc, measured, frame, TWO, compliance, (), None, {}, measurements)
    offset = candidates_on(made_model(fanuc.chain).sites)["joint_offset@2"]
    model = declared_model(campaign, (offset,))
    assert (model.rows, model.fitted_frames, model.targets) == (rows, fitted, TWO)
    assert model.identifies_compliance == (compliance == "identify")
    assert [effect.key for effect in model.effects][-1] == "joint_offset@2"
    np.testing.assert_array_equal(model.nominal_compliance, fanuc.compliance)
    assert model.time_zero_s == 5.0 and model.row_span == (4, 9)


def test_declared_model_weighs_what_the_robot_file_weighs(fanuc):
    bare = made_model(fanuc.chain, (Target("A", "6DoF", (0, 0, 0)),))
    measurements = made_measurements(bare, np.random.default_rng(0), 2, 1, 0.0, 0.0)
    robot = replace(fanuc, masses=(Mass(2, 100.0, (0.5, 0.0, 0.0), 0.1),), gravity_m_s2=(0.0, 0.0, 9.0), gear_ratio=(None,) * 6)
    model = declared_model(Campaign("c", robot, "position", "base", TWO, "identify", (), None, {}, measurements))
    assert [effect.key for effect in model.effects] == ["joint_compliance", "declared_weight"]
    assert model.sites.masses == robot.masses and model.sites.gravity_m_s2 == (0.0, 0.0, 9.0)


@pytest.mark.parametrize(
    ("chain", "slides"), [("Tz(q1) Tz(0.5) Ry(q2) Tx(1) [end]", True), ("Rz(q1) Tz(0.5) Ry(q2) Tx(1) [end]", False)]
)
def test_a_usual_weight_loads_an_arm_that_slides_and_of_which_neither_masses_nor_loads_are_known(chain, slides):
    robot, target = robot_of(chain), (Target("A", "end", (0, 0, 0)),)
    measurements = made_measurements(made_model(robot.chain, target), np.random.default_rng(0), 2, 1, 0.0, 0.0)

    def usual(robot, measurements):
        campaign = Campaign("c", robot, "position", "base", target, "nominal", (), None, {}, measurements)
        return declared_model(campaign).sites.usual_weight

    unloaded = replace(measurements, wrench=np.zeros_like(measurements.wrench))
    loaded = replace(measurements, wrench=np.ones_like(measurements.wrench))
    assert usual(robot, unloaded) == slides
    assert not usual(robot, loaded)
    assert not usual(replace(robot, masses=(Mass(1, 10.0, (0.1, 0.0, 0.0), 0.1),)), unloaded)


def test_parameters_are_named_in_the_order_of_the_sensitivities(full_case):
    model, estimate, _ = full_case
    owners = [owner for owner, _ in parameters(model, estimate)]
    of_target = model.rows
    expected = ["frame 0"] * 6 + ["frame 4"] * 6 + ["target A"] * of_target + ["target C"] * of_target
    assert owners == [*expected, *["joint_compliance"] * 6, *["lost_motion@2"] * 2, *["link_geometry@3"] * 6]
    names = [parameter.name for _, parameter in parameters(model, estimate)]
    assert names[:6] == ["dx", "dy", "dz", "rx", "ry", "rz"]
    assert names[-8:-6] == ["half_play", "torque"]


def test_of_a_target_only_what_is_unknown_is_a_parameter(fanuc):
    targets = [
        Target("turn", "6DoF", (0.0, 0.0, 0.1), None),
        Target("place", "6DoF", None, (0.0, 0.0, 1.5)),
        Target("known", "6DoF", (0.0, 0.0, 0.1), (1.0, 0.0, 0.0)),
        Target("both", "6DoF", None),
    ]
    names = {6: ["turn rx", "turn ry", "turn rz", "place dx", "place dy", "place dz"], 3: ["place dx", "place dy", "place dz"]}
    both = {6: ["dx", "dy", "dz", "rx", "ry", "rz"], 3: ["dx", "dy", "dz"]}
    for rows in (6, 3):
        model = made_model(fanuc.chain, targets, rows=rows, fitted_frames=False)
        estimate = made_estimate(model, seed=3)
        expected = [*names[rows], *(f"both {name}" for name in both[rows])]
        owned = parameters(model, estimate)
        assert [f"{owner.removeprefix('target ')} {parameter.name}" for owner, parameter in owned] == expected
        there = stepped(model, estimate, np.full(len(expected), 1e-3))
        moved = np.abs(there.target_offset - estimate.target_offset).max(axis=1) > 0
        turned = np.abs(there.target_rotation - estimate.target_rotation).max(axis=(1, 2)) > 1e-4
        assert moved.tolist() == [False, True, False, True] and turned.tolist() == [rows == 6, False, False, rows == 6]


@pytest.fixture
def two_laws(fanuc):
    """A model of two laws with a shape of one name, and one without, somewhere."""
    model = model_of(fanuc, "lost_motion@2", "link_geometry@3", "stiffening@4")
    return model, made_estimate(model, seed=7)


def owned(model, estimate, key, name):
    """Places of one parameter of one owner."""
    return [n for n, (owner, p) in enumerate(parameters(model, estimate)) if (owner, p.name) == (key, name)]


def test_only_shapes_have_limits_each_those_of_its_own_law(two_laws):
    model, estimate = two_laws
    found, expected = limits(model, estimate), np.tile([-np.inf, np.inf], (len(parameters(model, estimate)), 1))
    for effect in (model.effects[0], model.effects[2]):
        (place,) = owned(model, estimate, effect.key, "torque")
        expected[place] = effect.shapes[0].lowest, effect.shapes[0].highest
    np.testing.assert_array_equal(found, expected)
    np.testing.assert_array_equal(nonlinear_parameters(model, estimate), np.isfinite(expected[:, 0]))
    assert np.isfinite(expected).sum() == 4


@pytest.mark.parametrize(("step", "end"), [(-1e9, "lowest"), (1e9, "highest")])
@pytest.mark.parametrize("place", [0, 2])
def test_a_step_of_a_shape_ends_at_the_end_of_its_own_range(two_laws, place, step, end):
    model, estimate = two_laws
    whole = np.zeros(len(parameters(model, estimate)))
    whole[owned(model, estimate, model.effects[place].key, "torque")] = step
    there = stepped(model, estimate, whole)
    assert there.shapes[place].tolist() == [getattr(model.effects[place].shapes[0], end)]
    for number in {0, 1, 2} - {place}:
        np.testing.assert_array_equal(there.shapes[number], estimate.shapes[number])


def test_values_are_zero_for_frames_and_targets_and_those_of_coefficients_before_shapes(two_laws):
    model, estimate = two_laws
    whole = 1e-6 * np.arange(1.0, len(parameters(model, estimate)) + 1)
    there = stepped(model, estimate, whole)
    found = parameter_values(model, there)
    np.testing.assert_array_equal(found[:9], np.zeros(9))
    (play, taken_up), geometry, (beyond, meeting) = (
        np.concatenate([a, b]) for a, b in zip(estimate.coefficients, estimate.shapes, strict=True)
    )
    before = np.array([play, taken_up, *geometry, beyond, meeting])
    np.testing.assert_allclose(found[9:], before + whole[9:], rtol=1e-12, atol=0)


def equilibrium(chain, compliance, states, weighing=None):
    """Turn of each joint where the springs hold the load at the pose to which it has turned them, by scipy's root finder."""
    end = replace(chain.end_effector, offset_m=(0, 0, 0))

    def unbalanced(turned, q, wrench):
        torque = joint_torques(chain, q + turned, wrench, end)
        return turned - compliance * (torque if weighing is None else torque + weighing(q + turned))

    pairs = zip(states.joint_angles, states.wrench, strict=True)
    return np.array([root(unbalanced, np.zeros(len(q)), (q, wrench), tol=1e-15).x for q, wrench in pairs])


def test_nominal_springs_deflect_as_equation_9_with_exact_kinematics(fanuc):
    targets = tuple(Target(p.name, p.name, (0.05, 0.1, -0.1)) for p in fanuc.chain.points)
    model = made_model(fanuc.chain, targets, 6, fitted_frames=False, compliance=fanuc.compliance)
    estimate, states = made_estimate(model), made_states(6, 6, seed=4)
    seen = seen_exactly(model, estimate, states)
    position, rotation = predict(model, estimate, seen, conditions(model, estimate, states))
    turned = equilibrium(fanuc.chain, fanuc.compliance, states)
    for index, point in enumerate(fanuc.chain.points):
        target = replace(point, offset_m=(0.05, 0.1, -0.1))
        expected = poses(fanuc.chain, states.joint_angles + turned, target)
        np.testing.assert_allclose(position[seen.target == index], expected[0], rtol=0, atol=1e-9)
        np.testing.assert_allclose(rotation[seen.target == index], expected[1], rtol=0, atol=1e-9)
    bent = exact_deflections(fanuc.chain, states.joint_angles, turned, fanuc.chain.end_effector)
    assert np.abs(bent).max() > 1e-4


def test_effects_add_up_on_the_coordinates_of_the_sites(fanuc):
    known = candidates_on(made_model(fanuc.chain).sites)
    offset, growth, frame = (known[key] for key in ("joint_offset@2", "stiffening@2", "base_compliance"))
    model = made_model(fanuc.chain, compliance=fanuc.compliance, effects=(offset, growth, frame))
    estimate, states = made_estimate(model, seed=10), made_states(6, 5, seed=11)
    around = conditions(model, estimate, states)
    found = displaced_coordinates(model, estimate, around)
    torque = joint_torques(model.sites.chain, found, states.wrench, model.sites.chain.end_effector)[:, :6]
    expected = states.joint_angles + fanuc.compliance * torque
    (meeting,), load = estimate.shapes[1], torque[:, 1]
    beyond = load - meeting * np.tanh(load / meeting)
    expected[:, 1] += estimate.coefficients[0][0] + estimate.coefficients[1][0] * beyond
    np.testing.assert_allclose(found[:, :6], expected, rtol=0, atol=1e-9)
    at_base = found[:, list(model.sites.base)]
    np.testing.assert_allclose(at_base[:, :2], estimate.coefficients[2][0] * states.wrench[:, :2], rtol=1e-9, atol=1e-18)
    used = {*range(6), *model.sites.base}
    assert not np.delete(found, list(used), axis=1).any()


@pytest.mark.parametrize("name", OTHER_CHAINS)
def test_effects_at_zero_leave_the_declared_model(name):
    chain = chain_of(OTHER_CHAINS[name])
    model = made_model(chain, rows=6)
    estimate, states = made_estimate(model, seed=8), made_states(chain.coordinates, 4, seed=9)
    effects = tuple(candidates_on(model.sites).values())
    more, same = model.with_effects(effects), estimate.with_effects(effects)
    seen = seen_exactly(model, estimate, states)
    np.testing.assert_allclose(residuals(more, same, seen, conditions(more, same, states)), 0.0, atol=1e-14)
