"""Declared and undeclared weights: torques against pinocchio, sensitivities against central
differences, priors, and levers of pulls."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from scipy.spatial.transform import Rotation
from support import ODD_CHAINS, OTHER_CHAINS, PinocchioPoint, robot_of
from synthetic import (
    conditions_on,
    displacements,
    find_candidate,
    make_estimate,
    make_model,
    make_states,
    observe_exactly,
    slopes,
)

from elastocal.effects.catalogue import candidates_on, moves_robot
from elastocal.effects.conditions import build_conditions, find_offered_needs
from elastocal.effects.gravity import (
    declared_application_point,
    declared_weight,
    find_lever_of_pull,
)
from elastocal.fitting.linearization import linearize
from elastocal.fitting.model import (
    compute_displaced_coordinates,
    evaluate_conditions,
    list_parameters,
)
from elastocal.mechanics.kinematics import compute_motion
from elastocal.mechanics.robot import Mass
from elastocal.mechanics.sites import build_sites

PLACE = np.array([0.1, -0.4, 0.25])
TILTED = (3.0, -4.0, -8.0)


def weighed(robot):
    """The robot with a mass on each link and the column, its centres off the links'
    lines."""
    rng = np.random.default_rng(1)
    masses = [
        Mass(link, 10.0 + link, tuple(rng.uniform(-0.3, 0.3, 3)), 0.1)
        for link in range(robot.joints + 1)
    ]
    return replace(robot, masses=tuple(masses), gravity_m_s2=TILTED)


def gravity_by_pinocchio(chain, after, mass, centre, gravity, coordinates):
    """Generalized force of a mass behind so many transforms, on every coordinate of the
    chain, ndarray (S, C)."""
    # Pinocchio has joints only up to the mass; those behind it bear nothing of it.
    one = PinocchioPoint(
        chain, replace(chain.end_effector, after=after, offset_m=tuple(centre))
    )
    frame = one.model.frames[one.frame]
    inertia = pin.Inertia(mass, frame.placement.translation, np.zeros((3, 3)))
    one.model.appendBodyToJoint(frame.parentJoint, inertia, pin.SE3.Identity())
    one.model.gravity.linear = np.array(gravity)
    data = one.model.createData()
    actual = np.zeros((len(coordinates), chain.coordinates))
    for index, q in enumerate(coordinates):
        actual[index, one.order] = -pin.computeGeneralizedGravity(
            one.model, data, q[one.order]
        )
    return actual


@pytest.mark.parametrize("name", ["fanuc", "fixed rotations", "track"])
def test_gravity_at_the_displaced_pose_agrees_with_pinocchio(name, fanuc):
    robot = weighed(
        fanuc if name == "fanuc" else robot_of((OTHER_CHAINS | ODD_CHAINS)[name])
    )
    sites = build_sites(robot)
    model = make_model(robot, effects=[candidates_on(sites)["base_compliance"]])
    estimate = make_estimate(model, seed=2, size=1.0)
    states = make_states(robot.joints, 3, seed=3, force=300.0)
    around = evaluate_conditions(model, estimate, states)
    displaced = compute_displaced_coordinates(model, estimate, around)
    corrections = around.mass_corrections.reshape(-1, 4)
    assert corrections.any()
    expected = 0.0
    for mass, correction in zip(robot.masses, corrections, strict=True):
        total = mass.mass_kg + correction[0]
        centre = np.array(mass.centre_m) + correction[1:] / total
        # The coordinates that tilt its joint, or the base, carry the mass.
        carrying = sites.tilt[mass.link - 1] if mass.link else sites.base
        after = 1 + max(
            number
            for number, transform in enumerate(sites.chain.transforms)
            if transform.coordinate in carrying
        )
        expected = expected + gravity_by_pinocchio(
            sites.chain, after, total, centre, TILTED, displaced
        )
    np.testing.assert_allclose(
        around.gravity, expected, rtol=0, atol=1e-6 * np.abs(expected).max()
    )
    np.testing.assert_array_equal(around.total, around.load + around.gravity)


def select_effects(robot, keys):
    candidates = candidates_on(build_sites(robot))
    return [candidates[key] for key in keys]


@pytest.mark.parametrize("identified", [True, False], ids=["identified", "nominal"])
def test_sensitivities_to_masses_and_compliances_include_effects_that_they_load(
    fanuc, identified
):
    robot = weighed(fanuc)
    keys = (
        "stiffening@2",
        "lost_motion@3",
        "base_compliance",
        "joint_tilt@2",
        "payload",
        "force_misalignment[flange axes]",
    )
    model = make_model(
        robot,
        rows=6,
        compliance=fanuc.compliance,
        identified=identified,
        effects=select_effects(robot, keys),
    )
    estimate = make_estimate(model, seed=4)
    states = make_states(6, 8, seed=5)
    if identified:
        estimate = replace(
            estimate, coefficients=(fanuc.compliance, *estimate.coefficients[1:])
        )
    observations = observe_exactly(model, estimate, states)
    around = evaluate_conditions(model, estimate, states)
    listed = list_parameters(model, estimate)
    sizes = [
        1e-3 * (fanuc.compliance.max() if owner == "joint_compliance" else p.plausible)
        for owner, p in listed
    ]
    springs = [
        i
        for i, (owner, _) in enumerate(listed)
        if owner in ("joint_compliance", "declared_weight")
    ]
    steps = np.diag(sizes)[springs]
    expected = slopes(model, estimate, observations, around, steps)
    actual = linearize(model, estimate, observations, around).sensitivities @ steps.T
    largest = np.abs(expected).max(axis=(0, 1))
    np.testing.assert_allclose(
        actual / largest.max(), expected / largest.max(), rtol=0, atol=1e-6
    )
    moving = largest > 0
    assert moving.sum() >= 6 * identified + 20
    np.testing.assert_allclose(
        actual[..., moving] / largest[moving],
        expected[..., moving] / largest[moving],
        rtol=0,
        atol=2e-4,
    )


def test_priors_of_masses_follow_from_the_robot_file(fanuc):
    robot = replace(
        fanuc,
        masses=(
            Mass(2, 200.0, (0.3, 0.0, 0.4), 0.1),
            Mass(3, 50.0, (0.0, 0.0, 0.01), 0.2),
        ),
    )
    actual = declared_weight(build_sites(robot)).parameters
    # A centre is off by its relative error times its distance from the joint, and lies
    # anywhere in the girth of its link.
    width = 0.1 * np.linalg.norm(build_sites(robot).link_vectors_m, axis=1).sum()
    assert 0.3 < width < 0.7
    first = np.hypot(20.0 * 0.5, 200.0 * width / 12**0.5)
    second = np.hypot(10.0 * 0.1, 50.0 * width / 12**0.5)
    assert [p.prior_std for p in actual] == pytest.approx(
        [20.0, *[first] * 3, 10.0, *[second] * 3]
    )
    assert [p.name for p in actual[:2]] == [
        "mass_error_of_link_2",
        "moment_error_x_of_link_2",
    ]
    # As the file states it, a centre on its axis as if it were 0.1 m from there.
    assert [p.plausible for p in actual] == pytest.approx(
        [20.0, *[20.0 * 0.5] * 3, 10.0, *[10.0 * 0.1] * 3]
    )


@pytest.mark.parametrize(
    ("stated", "expected"),
    [
        ({"payload_kg": 210.0}, 0.15 * 210),
        # Arms carry a sixth of their own mass.
        ({"masses": (600.0, 300.0, 0.0)}, 0.15 * 900 / 6),
        ({"payload_kg": 20.0, "masses": (600.0, 300.0)}, 0.15 * 20),
        # Rated loads grow with the volume that an arm reaches.
        ({}, 0.15 * 8.0 * 3.107**3),
    ],
)
def test_plausible_payload_is_a_share_of_the_rated_or_estimated_payload(
    fanuc, stated, expected
):
    masses = tuple(
        Mass(2 + link, mass, (0.0, 0.0, 0.0), 0.1)
        for link, mass in enumerate(stated.get("masses", ()))
    )
    sites = replace(
        build_sites(replace(fanuc, payload_kg=None)),
        masses=masses,
        payload_kg=stated.get("payload_kg"),
    )
    tool, alone = (c for c in candidates_on(sites).values() if c.effect == "payload")
    assert [p.plausible for p in tool.parameters] == pytest.approx(
        [expected, *[0.2 * expected] * 3]
    )
    assert [p.plausible for p in alone.parameters] == pytest.approx([expected])


@pytest.mark.parametrize("share", [0.0, 0.005, 0.05])
def test_the_lever_of_a_pull_is_found_if_moments_are_a_hundredth_off(
    share,
):
    """Forces and flange orientations are random."""
    rng = np.random.default_rng(0)
    force = 300.0 * rng.standard_normal((8, 3))
    rotation = Rotation.random(8, rng=rng).as_matrix()
    moment = np.cross(rotation @ PLACE, force)
    noise = rng.standard_normal((8, 3))
    moment = moment + share * noise * np.linalg.norm(moment) / np.linalg.norm(noise)
    lever = find_lever_of_pull(np.concatenate([force, moment], axis=1), rotation)
    np.testing.assert_allclose(
        lever, 0 * force if share > 0.01 else rotation @ PLACE, atol=4 * share + 1e-9
    )


def test_a_bias_acts_in_all_states_with_a_recorded_force_or_moment(fanuc):
    states = make_states(6, 3, seed=4)
    states.wrench[:] = [
        [300.0, 20.0, 10.0, 1.0, 2.0, 3.0],
        [0, 0, 0, 0, 5.0, 0],
        [0] * 6,
    ]
    around = conditions_on(fanuc.chain, states)
    made = displacements(find_candidate(fanuc.chain, "force_bias[base axes]"), around)[
        ..., :6
    ]
    for axis, turned in enumerate(made):
        force = np.eye(6)[[axis, axis]]
        expected = (
            around.load_by(np.concatenate([force, 0 * force[:1]]))[:, :6]
            * around.compliance
        )
        np.testing.assert_allclose(turned, expected, rtol=1e-12)


def test_without_masses_and_loads_the_structure_bears_the_usual_weight(
    fanuc,
):
    """Half of each link at either end, six times the rated load in all: slopes of its
    potential energy."""
    states = make_states(6, 4, seed=7)
    states.wrench[:] = 0.0
    sites = replace(
        build_sites(replace(fanuc, payload_kg=100.0)), bears_typical_weight=True
    )
    around = build_conditions(sites, fanuc.compliance, states)
    assert sites.typical_masses_kg.sum() == pytest.approx(600.0)
    assert find_offered_needs(sites, states) & {"load", "load on the joints"} == {
        "load"
    }

    def energy(coordinates):
        ends = compute_motion(sites.chain, coordinates, sites.tracked_points).position[
            1 : sites.joints + 2
        ]
        return -np.einsum(
            "k,kis,i->s", sites.typical_masses_kg, ends, np.array(sites.gravity_m_s2)
        )

    commanded = np.zeros((4, sites.chain.coordinates))
    commanded[:, :6] = states.joint_angles
    for coordinate in (*sites.base, *sites.tilt[1], *sites.link_end[2]):
        step = np.zeros(sites.chain.coordinates)
        step[coordinate] = 1e-4
        slope = (energy(commanded + step) - energy(commanded - step)) / 2e-4
        np.testing.assert_allclose(around.total[:, coordinate], -slope, atol=1e-3)
    assert not around.total[:, :6].any()


def test_a_declared_application_point_acts_as_the_effect_of_the_catalogue(fanuc):
    """Its error belongs to the measurements, and tasks do not feel it."""
    conditions = conditions_on(fanuc, make_states(6, 5))
    declared = declared_application_point(conditions.sites, 1e-3)
    found = find_candidate(fanuc, "application_point[flange axes]")
    np.testing.assert_array_equal(
        displacements(declared, conditions), displacements(found, conditions)
    )
    assert [parameter.prior_std for parameter in declared.parameters] == [1e-3] * 3
    assert not moves_robot(declared)
