"""Weights, declared or not: torques by pinocchio, slopes by central differences, fits with wrong masses, a compensator."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from scipy.stats import chi2
from support import ODD_CHAINS, OTHER_CHAINS, PinocchioPoint, robot_of
from synthetic import (
    NOISE,
    candidate_on,
    conditions_on,
    displacements,
    made_estimate,
    made_model,
    made_states,
    seen_exactly,
    slopes,
    with_noise,
)

from elastocal.campaigns.campaign import Target
from elastocal.effects.catalogue import candidates_on
from elastocal.effects.conditions import conditions_of, offered, with_springs
from elastocal.effects.gravity import declared_weight
from elastocal.fitting.least_squares import fit
from elastocal.fitting.linearization import linearize
from elastocal.fitting.model import conditions, displaced_coordinates, parameters
from elastocal.mechanics.chain import MeasuringPoint
from elastocal.mechanics.kinematics import motion, poses
from elastocal.mechanics.robot import Mass
from elastocal.mechanics.sites import sites_of

TILTED = (3.0, -4.0, -8.0)


def weighed(robot, gravity=TILTED, std=0.1):
    """The robot with a mass on each link and the column, its centres off the links' lines."""
    rng = np.random.default_rng(1)
    masses = [Mass(link, 10.0 + link, tuple(rng.uniform(-0.3, 0.3, 3)), std) for link in range(robot.joints + 1)]
    return replace(robot, masses=tuple(masses), gravity_m_s2=gravity)


def robots(fanuc):
    return {"fanuc": fanuc} | {name: robot_of(text) for name, text in OTHER_CHAINS.items()}


def gravity_by_pinocchio(chain, after, mass, centre, gravity, coordinates):
    """Generalized force of a mass behind so many transforms, on every coordinate of the chain, ndarray (S, C)."""
    # Pinocchio has joints only up to the mass; those behind it bear nothing of it.
    one = PinocchioPoint(chain, replace(chain.end_effector, after=after, offset_m=tuple(centre)))
    frame = one.model.frames[one.frame]
    inertia = pin.Inertia(mass, frame.placement.translation, np.zeros((3, 3)))
    one.model.appendBodyToJoint(frame.parentJoint, inertia, pin.SE3.Identity())
    one.model.gravity.linear = np.array(gravity)
    data, found = one.model.createData(), np.zeros((len(coordinates), chain.coordinates))
    for index, q in enumerate(coordinates):
        found[index, one.order] = -pin.computeGeneralizedGravity(one.model, data, q[one.order])
    return found


def carried(chain, link):
    """How many transforms come before the frame directly behind the joint that carries a link, on the robot's own chain."""
    return next(i + 1 for i, t in enumerate(chain.transforms) if t.coordinate == link - 1) if link else 0


@pytest.mark.parametrize("name", ["fanuc", *OTHER_CHAINS])
def test_gravity_on_the_joints_is_that_of_pinocchio_on_the_robots_own_chain(name, fanuc):
    robot = weighed(robots(fanuc)[name])
    states = made_states(robot.joints, 4, seed=1, span=3.0)
    found = conditions_on(robot, states).gravity[:, : robot.joints]
    expected = sum(
        gravity_by_pinocchio(robot.chain, carried(robot.chain, m.link), m.mass_kg, m.centre_m, TILTED, states.joint_angles)
        for m in robot.masses
        if m.link
    )
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-11)
    assert np.abs(expected).max() > 10


@pytest.mark.parametrize("name", ["fanuc", "fixed rotations"])
def test_gravity_on_every_coordinate_where_the_robot_has_yielded_is_that_of_pinocchio(name, fanuc):
    robot = weighed(robots(fanuc)[name])
    sites = sites_of(robot)
    base = candidates_on(sites)["base_compliance"]
    model = made_model(robot, effects=(base,))
    estimate, states = made_estimate(model, seed=2, size=1.0), made_states(robot.joints, 3, seed=3, force=300.0)
    around = conditions(model, estimate, states)
    at = displaced_coordinates(model, estimate, around)
    corrections = around.mass_corrections.reshape(-1, 4)
    assert corrections.any()
    expected = 0.0
    for mass, correction in zip(robot.masses, corrections, strict=True):
        total = mass.mass_kg + correction[0]
        centre = np.array(mass.centre_m) + correction[1:] / total
        after = sites.body(mass.link).after
        expected = expected + gravity_by_pinocchio(sites.chain, after, total, centre, TILTED, at)
    np.testing.assert_allclose(around.gravity, expected, rtol=0, atol=1e-6 * np.abs(expected).max())
    np.testing.assert_array_equal(around.total, around.load + around.gravity)
    # The foot bears the whole weight.
    np.testing.assert_allclose(
        around.gravity[:, list(sites.base[:2])].mean(axis=0), weight_of(robot, corrections)[:2], rtol=1e-3
    )


def weight_of(robot, corrections):
    return (sum(mass.mass_kg for mass in robot.masses) + corrections[:, 0].sum()) * np.array(TILTED)


@pytest.mark.parametrize("identified", [True, False], ids=["identified", "nominal"])
def test_masses_and_compliances_have_exact_sensitivities_with_all_that_they_load(fanuc, identified):
    robot = weighed(fanuc)
    known = candidates_on(sites_of(robot))
    keys = ("stiffening@2", "lost_motion@3", "base_compliance", "joint_tilt@2", "payload", "force_misalignment[flange axes]")
    model = made_model(robot, rows=6, compliance=fanuc.compliance, identified=identified, effects=[known[key] for key in keys])
    estimate, states = made_estimate(model, seed=4), made_states(6, 8, seed=5)
    if identified:
        estimate = replace(estimate, coefficients=(fanuc.compliance, *estimate.coefficients[1:]))
    seen = seen_exactly(model, estimate, states)
    around = conditions(model, estimate, states)
    listed = parameters(model, estimate)
    sizes = [1e-3 * (fanuc.compliance.max() if owner == "joint_compliance" else p.plausible) for owner, p in listed]
    springs = [i for i, (owner, _) in enumerate(listed) if owner in ("joint_compliance", "declared_weight")]
    steps = np.diag(sizes)[springs]
    expected = slopes(model, estimate, seen, around, steps)
    found = linearize(model, estimate, seen, around).sensitivities @ steps.T
    largest = np.abs(expected).max(axis=(0, 1))
    np.testing.assert_allclose(found / largest.max(), expected / largest.max(), rtol=0, atol=1e-6)
    moving = largest > 0
    assert moving.sum() >= 6 * identified + 20
    np.testing.assert_allclose(found[..., moving] / largest[moving], expected[..., moving] / largest[moving], rtol=0, atol=2e-4)


def test_torques_of_masses_are_slopes_of_the_gravity(fanuc):
    robot = weighed(fanuc)
    around = conditions_on(robot, made_states(6, 5, seed=6))
    for number in range(len(around.mass_corrections)):
        step = np.zeros(len(around.mass_corrections))
        step[number] = 0.5
        moved = with_springs(around, around.compliance, step)
        change = (moved.gravity - around.gravity)[:, :6] / 0.5
        np.testing.assert_allclose(around.mass_torques[number], change, rtol=0, atol=1e-10)
    made = displacements(declared_weight(around.sites), around)
    np.testing.assert_allclose(made[..., :6], around.mass_torques * around.compliance, rtol=1e-14)


@pytest.mark.parametrize("name", ["fanuc", *ODD_CHAINS])
@pytest.mark.parametrize("some", [slice(None), slice(2, None, 3), slice(1, 2)])
def test_growth_of_gravity_with_each_correction_is_its_slope_on_the_coordinates_asked_for(fanuc, name, some):
    robot = weighed(fanuc if name == "fanuc" else robot_of(ODD_CHAINS[name]))
    around = conditions_on(robot, made_states(robot.joints, 5, seed=8))
    coordinates = np.arange(around.sites.chain.coordinates)[some]
    found = list(around.gravity_of_corrections(coordinates))
    assert len(found) == len(around.mass_corrections) >= 4
    for number, grown in enumerate(found):
        step = np.zeros(len(around.mass_corrections))
        step[number] = 0.5
        change = (with_springs(around, around.compliance, step).gravity - around.gravity)[:, coordinates] / 0.5
        np.testing.assert_allclose(grown, change.T, rtol=0, atol=1e-10)


def test_priors_are_those_of_the_robot_file(fanuc):
    robot = replace(fanuc, masses=(Mass(2, 200.0, (0.3, 0.0, 0.4), 0.1), Mass(3, 50.0, (0.0, 0.0, 0.01), 0.2)))
    found = declared_weight(sites_of(robot)).parameters
    # A centre is off by its relative error times its distance from the joint, and lies anywhere in the girth of its link.
    width = 0.1 * np.linalg.norm(sites_of(robot).link_vectors_m, axis=1).sum()
    assert 0.3 < width < 0.7
    first, second = np.hypot(20.0 * 0.5, 200.0 * width / 12**0.5), np.hypot(10.0 * 0.1, 50.0 * width / 12**0.5)
    assert [p.prior_std for p in found] == pytest.approx([20.0, *[first] * 3, 10.0, *[second] * 3])
    assert [p.name for p in found[:2]] == ["mass_error_of_link_2", "moment_error_x_of_link_2"]
    # As the file states it, a centre on its axis as if it were 0.1 m from there.
    assert [p.plausible for p in found] == pytest.approx([20.0, *[20.0 * 0.5] * 3, 10.0, *[10.0 * 0.1] * 3])


def test_structure_bears_the_usual_weight_where_neither_masses_nor_loads_are_known(fanuc):
    """Half of each link at either end, six times the rated load in all: slopes of its potential energy."""
    states = made_states(6, 4, seed=7)
    states.wrench[:] = 0.0
    sites = replace(sites_of(replace(fanuc, payload_kg=100.0)), usual_weight=True)
    around = conditions_of(sites, fanuc.compliance, states)
    assert sites.usual_masses.sum() == pytest.approx(600.0)
    assert offered(sites, states) & {"load", "load on the joints"} == {"load"}

    def energy(coordinates):
        ends = motion(sites.chain, coordinates, sites.followed).position[1 : sites.joints + 2]
        return -np.einsum("k,kis,i->s", sites.usual_masses, ends, np.array(sites.gravity_m_s2))

    commanded = np.zeros((4, sites.chain.coordinates))
    commanded[:, :6] = states.joint_angles
    for coordinate in (*sites.base, *sites.tilt[1], *sites.link_end[2]):
        step = np.zeros(sites.chain.coordinates)
        step[coordinate] = 1e-4
        slope = (energy(commanded + step) - energy(commanded - step)) / 2e-4
        np.testing.assert_allclose(around.total[:, coordinate], -slope, atol=1e-3)
    assert not around.total[:, :6].any()


@pytest.mark.parametrize("key", ["payload", "link_weight@1", "link_weight@2"])
def test_weights_hang_along_the_gravity_of_the_robot_file(key, fanuc):
    """On a wall the weight of a robot is that of one on the floor whose foot is turned."""
    # Gravity along +x of the base: on the floor the base would be turned by a quarter turn about y.
    hanging = replace(fanuc, gravity_m_s2=(9.80665, 0.0, 0.0))
    states = made_states(6, 5, seed=9)
    turned = robot_of(
        "Ry(90deg) Tz(0.670) Rz(q1) Tx(0.312) Ry(q2) Tx(1.075) Ry(q3) Tz(0.225) Tx(1.280) Rx(q4) Ry(q5) Rx(q6) Tx(0.215) [6DoF]"
    )
    found, expected = (
        displacements(candidates_on(sites_of(robot))[key], conditions_on(robot, states))[..., :6] for robot in (hanging, turned)
    )
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-10)
    assert found.any()


def test_wrong_masses_are_borne_by_their_priors_and_gears_still_seen(fanuc):
    """Masses and centres off by what the file allows leave no misfit; without their errors in the model they do."""
    declared = replace(weighed(fanuc, (0.0, 0.0, -9.80665)), masses=REAL)
    model = made_model(declared, TARGETS, fitted_frames=False, compliance=fanuc.compliance)
    true = made_estimate(model, seed=10, size=1.5)
    states = made_states(6, 40, seed=11, force=300.0)
    seen = with_noise(seen_exactly(model, true, states), np.random.default_rng(12))
    found = fit(model, seen, NOISE)
    chi_squared = (found.whitened(found.residual) ** 2).sum()
    freedom = found.residual.size - int((~found.held).sum())
    # At 0.1 %; a mean square that is half as large again is seen with a power of 0.91.
    assert found.converged and chi_squared < chi2.isf(1e-3, freedom)
    assert chi2.sf(chi2.isf(1e-3, freedom) / 1.5, freedom) > 0.9
    rigid = fit(replace(model, effects=()), seen, NOISE)
    assert (rigid.whitened(rigid.residual) ** 2).sum() > 1.5 * freedom
    # Errors of masses come back within their standard errors, which are smaller than the priors where the data tell.
    deviation = np.sqrt(np.diag(found.covariance))
    free = deviation > 0
    # All ten together with their correlations, at 0.1 %; standard errors that are a half of what they should be are seen with a
    # power of 0.69, a third with one above 0.95.
    error = (found.estimate.coefficients[0] - true.coefficients[0])[free]
    square = error @ np.linalg.solve(found.covariance[np.ix_(free, free)], error)
    assert square < chi2.isf(1e-3, free.sum()) and chi2.sf(chi2.isf(1e-3, free.sum()) / 9, free.sum()) > 0.95
    prior = np.array([p.prior_std for _, p in found.parameters])
    assert (deviation[free] / prior[free]).min() < 0.3 and (deviation <= prior * (1 + 1e-9)).all()


REAL = (
    Mass(1, 280.0, (0.1, 0.02, -0.10), 0.1),
    Mass(2, 190.0, (0.52, 0.05, 0.0), 0.1),
    Mass(3, 220.0, (0.35, -0.04, 0.2), 0.1),
    Mass(5, 30.0, (0.03, 0.0, 0.0), 0.1),
)
TARGETS = (Target("hand", "6DoF", (0.1, 0.05, 0.02)), Target("elbow", "3DoF", (0.0, 0.1, 0.05)))


@pytest.mark.parametrize("name", ODD_CHAINS)
def test_gravity_on_odd_robots_is_the_slope_of_their_potential(name):
    """Of carriages and of passive joints too: minus the change of m g h, by central differences."""
    robot = weighed(robot_of(ODD_CHAINS[name]))
    states = made_states(robot.joints, 4, seed=21)
    found = conditions_on(robot, states).gravity[:, : robot.joints]

    def work(q):
        frames = [MeasuringPoint("m", carried(robot.chain, m.link), m.centre_m) for m in robot.masses]
        at = [poses(robot.chain, q, frame)[0] for frame in frames]
        return sum(m.mass_kg * position @ np.array(TILTED) for m, position in zip(robot.masses, at, strict=True))

    for joint in range(robot.joints):
        step = 1e-5 * np.eye(robot.joints)[joint]
        slope = (work(states.joint_angles + step) - work(states.joint_angles - step)) / 2e-5
        np.testing.assert_allclose(found[:, joint], slope, rtol=0, atol=1e-7)


@pytest.mark.parametrize(
    ("known", "expected"),
    [
        ({"payload_kg": 210.0}, 0.15 * 210),
        # A sixth of the arm's own mass is what arms carry.
        ({"masses": (600.0, 300.0, 0.0)}, 0.15 * 900 / 6),
        ({"payload_kg": 20.0, "masses": (600.0, 300.0)}, 0.15 * 20),
        # Rated loads grow with the volume that an arm reaches.
        ({}, 0.15 * 8.0 * 3.107**3),
    ],
)
def test_plausible_payload_is_a_share_of_what_the_robot_carries_as_far_as_that_is_known(fanuc, known, expected):
    masses = tuple(Mass(2 + link, mass, (0.0, 0.0, 0.0), 0.1) for link, mass in enumerate(known.get("masses", ())))
    sites = replace(sites_of(fanuc.chain), masses=masses, payload_kg=known.get("payload_kg"))
    tool, alone = (c for c in candidates_on(sites).values() if c.effect == "payload")
    assert [p.plausible for p in tool.parameters] == pytest.approx([expected, *[0.2 * expected] * 3])
    assert [p.plausible for p in alone.parameters] == pytest.approx([expected])


def compensator(q, stiffness, crank, length, rest, start):
    """Torque of a spring between a crank on the joint and the frame."""
    distance = np.sqrt(crank**2 + length**2 + 2 * crank * length * np.cos(start + q))
    return stiffness * crank * length * (1 - rest / distance) * np.sin(start + q)


@pytest.mark.parametrize("start", [0.0, 0.7, 2.5])
def test_compensator_torque_spans_the_formula_of_a_spring_with_a_short_crank(start, fanuc):
    states = made_states(6, 60, seed=4)
    around = conditions_on(fanuc.chain, states)
    made = displacements(candidate_on(fanuc.chain, "compensator_torque@2"), around)
    assert not np.delete(made, 1, axis=2).any()
    columns = made[:, :, 1].T
    leftovers = []
    for crank in (0.1, 0.05):
        torque = compensator(states.joint_angles[:, 1], 1e4, crank, 1.0, 0.6, start)
        left = torque - columns @ np.linalg.lstsq(columns, torque, rcond=None)[0]
        leftovers.append(np.linalg.norm(left) / np.linalg.norm(torque))
    # What is left is of second order in crank over length.
    assert leftovers[0] < 0.005
    assert leftovers[1] < 0.4 * leftovers[0]
