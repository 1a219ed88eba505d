"""The model that a campaign declares, its parameters in one vector, and what it
predicts."""

from dataclasses import replace

import numpy as np
import pytest
from fitted_models import build_model
from made_campaigns import POINTS, Plan, make_campaign
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
from elastocal.fitting.model import (
    apply_step,
    build_case,
    build_declared_model,
    compute_residuals,
    evaluate_conditions,
    find_nonlinear_parameters,
    get_parameter_bounds,
    list_parameters,
    predict,
)
from elastocal.io.documents import read_document
from elastocal.mechanics.elastostatics import (
    compute_exact_deflections,
    compute_joint_torques,
)
from elastocal.mechanics.kinematics import compute_poses

TWO = Target("A", "6DoF", None), Target("B", "3DoF", (0.1, 0.0, -0.2))


@pytest.fixture(scope="module")
def campaign(kuka):
    return make_campaign(kuka, 1, Plan(poses=5, loads=1, repeats=4, tracker=True))


def described(campaign, config_folder, **changes):
    """What step 1 writes of the campaign."""
    document = {
        "campaign": "cell7",
        "robot": "kuka",
        "measured": campaign.measured,
        "frame": campaign.frame,
        "targets": {
            f"T{name}": {"point": name, "offset_m": "unknown"} for name in POINTS
        },
    }
    robot = read_document(config_folder / "robots" / "kuka.yaml")
    return {
        "source": "cell7/campaign.yaml",
        "campaign": document | changes,
        "robot": robot,
    }


def case_of(campaign, config_folder, **changes):
    return build_case(
        described(campaign, config_folder, **changes),
        tabulate_measurements(campaign.measurements),
    )


def test_a_model_of_rigid_joints_knows_that_no_compliances_are_known(
    campaign, config_folder
):
    described_ = described(campaign, config_folder)
    del described_["robot"]["compliance_urad_per_Nm"]
    described_["robot"]["masses"] = [
        {"link": 2, "mass_kg": 10, "centre_m": [0.3, 0, 0], "relative_std": 0.2}
    ]
    case = build_case(described_, tabulate_measurements(campaign.measurements))
    assert (
        not case.model.compliance_known
        and not case.model.nominal_compliance.any()
        and not case.model.sites.masses
    )
    described_["campaign"]["compliance"] = "identify"
    case = build_case(described_, tabulate_measurements(campaign.measurements))
    assert (
        not case.model.compliance_known
        and (case.model.nominal_compliance > 0).all()
        and case.model.sites.masses
    )


@pytest.mark.parametrize(
    ("compliance", "springs"), [("identify", ["joint_compliance"]), ("nominal", [])]
)
def test_the_model_has_the_declared_effects_and_the_candidates_are_all_others(
    campaign, config_folder, compliance, springs
):
    case = case_of(
        campaign,
        config_folder,
        compliance=compliance,
        declared=["joint_offset", "hysteresis"],
    )
    found = {effect.effect for effect in case.model.effects}
    assert found == {*springs, "hysteresis", "joint_offset"}
    assert [e.key for e in case.model.effects if e.effect == "joint_offset"] == [
        f"joint_offset@{j}" for j in range(1, 7)
    ]
    missing = {candidate.effect for candidate in case.candidates.values()}
    assert (
        not missing & {"joint_offset", "hysteresis"}
        and {"lost_motion", "link_weight", "frame_drift"} <= missing
    )
    assert all(key == candidate.key for key, candidate in case.candidates.items())
    more = set(case_of(campaign, config_folder).candidates) - set(case.candidates)
    assert more >= {e.key for e in case.model.effects if e.effect not in springs}
    assert {key.split("@")[0] for key in more} == {"joint_offset", "hysteresis"}


@pytest.mark.parametrize(("measured", "rows"), [("position", 3), ("pose", 6)])
@pytest.mark.parametrize(("frame", "fitted"), [("tracker", True), ("base", False)])
@pytest.mark.parametrize("compliance", ["nominal", "identify"])
def test_declared_model_is_that_of_the_campaign(
    fanuc, measured, rows, frame, fitted, compliance
):
    bare = make_model(fanuc.chain, (Target("A", "6DoF", (0, 0, 0)),))
    measurements = make_measurements(bare, np.random.default_rng(0), 2, 1, 0.0, 0.0)
    measurements = replace(
        measurements, time_s=np.array([7.0, 5.0]), row=np.array([4, 9])
    )
    campaign = Campaign(
        "c", fanuc, measured, frame, TWO, compliance, (), None, {}, measurements
    )
    offset = candidates_on(make_model(fanuc.chain).sites)["joint_offset@2"]
    model = build_declared_model(campaign, (offset,))
    assert (model.rows, model.fitted_frames, model.targets) == (rows, fitted, TWO)
    assert model.identifies_compliance == (compliance == "identify")
    assert [effect.key for effect in model.effects][-1] == "joint_offset@2"
    np.testing.assert_array_equal(model.nominal_compliance, fanuc.compliance)
    assert model.time_zero_s == 5.0 and model.row_span == (4, 9)


def test_parameters_are_named_in_the_order_of_the_sensitivities(full_case):
    model, estimate, _ = full_case
    owners = [owner for owner, _ in list_parameters(model, estimate)]
    of_target = model.rows
    expected = (
        ["frame 0"] * 6
        + ["frame 4"] * 6
        + ["target A"] * of_target
        + ["target C"] * of_target
    )
    assert owners == [
        *expected,
        *["joint_compliance"] * 6,
        *["lost_motion@2"] * 2,
        *["link_geometry@3"] * 6,
    ]
    names = [parameter.name for _, parameter in list_parameters(model, estimate)]
    assert names[:6] == ["dx", "dy", "dz", "rx", "ry", "rz"]
    assert names[-8:-6] == ["half_play", "torque"]


def test_of_a_target_only_what_is_unknown_is_a_parameter(fanuc):
    targets = [
        Target("turn", "6DoF", (0.0, 0.0, 0.1), None),
        Target("place", "6DoF", None, (0.0, 0.0, 1.5)),
        Target("known", "6DoF", (0.0, 0.0, 0.1), (1.0, 0.0, 0.0)),
        Target("both", "6DoF", None),
    ]
    names = {
        6: ["turn rx", "turn ry", "turn rz", "place dx", "place dy", "place dz"],
        3: ["place dx", "place dy", "place dz"],
    }
    both = {6: ["dx", "dy", "dz", "rx", "ry", "rz"], 3: ["dx", "dy", "dz"]}
    for rows in (6, 3):
        model = make_model(fanuc.chain, targets, rows=rows, fitted_frames=False)
        estimate = make_estimate(model, seed=3)
        expected = [*names[rows], *(f"both {name}" for name in both[rows])]
        owned = list_parameters(model, estimate)
        assert [
            f"{owner.removeprefix('target ')} {parameter.name}"
            for owner, parameter in owned
        ] == expected
        there = apply_step(model, estimate, np.full(len(expected), 1e-3))
        moved = np.abs(there.target_offset - estimate.target_offset).max(axis=1) > 0
        turned = (
            np.abs(there.target_rotation - estimate.target_rotation).max(axis=(1, 2))
            > 1e-4
        )
        assert moved.tolist() == [False, True, False, True] and turned.tolist() == [
            rows == 6,
            False,
            False,
            rows == 6,
        ]


@pytest.fixture
def two_laws(fanuc):
    """A model of two laws with a shape of one name, and one without, somewhere."""
    model = build_model(fanuc, "lost_motion@2", "link_geometry@3", "stiffening@4")
    return model, make_estimate(model, seed=7)


def owned(model, estimate, key, name):
    """Places of one parameter of one owner."""
    return [
        n
        for n, (owner, p) in enumerate(list_parameters(model, estimate))
        if (owner, p.name) == (key, name)
    ]


def test_only_shapes_have_limits_each_those_of_its_own_law(two_laws):
    model, estimate = two_laws
    found = get_parameter_bounds(model, estimate)
    expected = np.tile([-np.inf, np.inf], (len(list_parameters(model, estimate)), 1))
    for effect in (model.effects[0], model.effects[2]):
        (place,) = owned(model, estimate, effect.key, "torque")
        expected[place] = effect.shapes[0].lowest, effect.shapes[0].highest
    np.testing.assert_array_equal(found, expected)
    np.testing.assert_array_equal(
        find_nonlinear_parameters(model, estimate), np.isfinite(expected[:, 0])
    )
    assert np.isfinite(expected).sum() == 4


def equilibrium(chain, compliance, states, weighing=None):
    """Turn of each joint where the springs hold the load at the pose to which it has
    turned them, by scipy's root finder."""
    end = replace(chain.end_effector, offset_m=(0, 0, 0))

    def unbalanced(turned, q, wrench):
        torque = compute_joint_torques(chain, q + turned, wrench, end)
        return turned - compliance * (
            torque if weighing is None else torque + weighing(q + turned)
        )

    pairs = zip(states.joint_angles, states.wrench, strict=True)
    return np.array(
        [
            root(unbalanced, np.zeros(len(q)), (q, wrench), tol=1e-15).x
            for q, wrench in pairs
        ]
    )


def test_nominal_springs_deflect_as_equation_9_with_exact_kinematics(fanuc):
    targets = tuple(
        Target(p.name, p.name, (0.05, 0.1, -0.1)) for p in fanuc.chain.points
    )
    model = make_model(
        fanuc.chain, targets, 6, fitted_frames=False, compliance=fanuc.compliance
    )
    estimate = make_estimate(model)
    states = make_states(6, 6, seed=4)
    seen = observe_exactly(model, estimate, states)
    position, rotation = predict(
        model, estimate, seen, evaluate_conditions(model, estimate, states)
    )
    turned = equilibrium(fanuc.chain, fanuc.compliance, states)
    for index, point in enumerate(fanuc.chain.points):
        target = replace(point, offset_m=(0.05, 0.1, -0.1))
        expected = compute_poses(fanuc.chain, states.joint_angles + turned, target)
        np.testing.assert_allclose(
            position[seen.target == index], expected[0], rtol=0, atol=1e-9
        )
        np.testing.assert_allclose(
            rotation[seen.target == index], expected[1], rtol=0, atol=1e-9
        )
    bent = compute_exact_deflections(
        fanuc.chain, states.joint_angles, turned, fanuc.chain.end_effector
    )
    assert np.abs(bent).max() > 1e-4


@pytest.mark.parametrize("name", OTHER_CHAINS)
def test_effects_at_zero_leave_the_declared_model(name):
    chain = chain_of(OTHER_CHAINS[name])
    model = make_model(chain, rows=6)
    estimate = make_estimate(model, seed=8)
    states = make_states(chain.coordinates, 4, seed=9)
    effects = tuple(candidates_on(model.sites).values())
    more = model.with_effects(effects)
    same = estimate.with_effects(effects)
    seen = observe_exactly(model, estimate, states)
    np.testing.assert_allclose(
        compute_residuals(more, same, seen, evaluate_conditions(more, same, states)),
        0.0,
        atol=1e-14,
    )
