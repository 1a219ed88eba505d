"""Effects without load: weights by pinocchio, wrong dimensions by other chains, the compensator by its formula."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from support import OTHER_CHAINS, PinocchioPoint, chain_of, robot_of
from synthetic import candidate_on, conditions_on, displacements, made_estimate, made_model, made_states, seen_exactly

from elastocal.campaigns.campaign import Target
from elastocal.effects.catalogue import candidates_on
from elastocal.fitting.displacement import conditions
from elastocal.fitting.prediction import predict
from elastocal.mechanics.chain import MeasuringPoint
from elastocal.mechanics.kinematics import poses
from elastocal.mechanics.robot import Mass
from elastocal.mechanics.sites import sites_of
from elastocal_proof.plant.tracker import EccentricNest

GRAVITY = 9.80665


def gravity_torques(chain, angles, after, mass, centre=(0.0, 0.0, 0.0)):
    """Torque on each joint by a mass that hangs at a point of the chain: pinocchio's generalized gravity, turned round."""
    one = PinocchioPoint(chain, replace(chain.end_effector, after=after, offset_m=tuple(centre)))
    frame = one.model.frames[one.frame]
    inertia = pin.Inertia(mass, frame.placement.translation, np.zeros((3, 3)))
    one.model.appendBodyToJoint(frame.parentJoint, inertia, pin.SE3.Identity())
    one.model.gravity.linear = np.array([0.0, 0.0, -GRAVITY])
    data, torques = one.model.createData(), np.zeros(angles.shape)
    for index, q in enumerate(angles):
        torques[index, one.order] = -pin.computeGeneralizedGravity(one.model, data, q[one.order])
    return torques


def far_ends(chain):
    """How many transforms come before the far end of each link, 0 the column."""
    return [*(i for i, t in enumerate(chain.transforms) if t.coordinate is not None), len(chain.transforms)]


@pytest.mark.parametrize("name", ["fanuc", *OTHER_CHAINS])
def test_link_weight_is_the_gravity_of_point_masses_by_pinocchio(name, fanuc):
    chain = fanuc.chain if name == "fanuc" else chain_of(OTHER_CHAINS[name])
    states = made_states(chain.coordinates, 5, seed=1, span=3.0)
    compliance = 1e-6 * np.arange(1, chain.coordinates + 1)
    around = conditions_on(chain, states, compliance)
    found = [c for c in candidates_on(around.sites).values() if c.effect == "link_weight"]
    assert {bool(candidate.joints) for candidate in found} == {True, False}
    for candidate in found:
        for column, parameter in zip(displacements(candidate, around), candidate.parameters, strict=True):
            link = int(parameter.name.split("_")[-1])
            expected, after = np.zeros_like(column), far_ends(chain)[link]
            torques = gravity_torques(chain, states.joint_angles, after, 1.0)
            if "moment" in parameter.name:
                # What a kilogram does more, one metre off along an axis of the frame at the far end.
                off = np.eye(3)["xyz".index(parameter.name.split("moment_")[1][0])]
                torques = gravity_torques(chain, states.joint_angles, after, 1.0, off) - torques
            # Of one joint by its compliance times the mass, of the arm by the mass alone.
            if candidate.joints:
                (joint,) = candidate.joints
                expected[:, joint - 1] = torques[:, joint - 1]
            else:
                expected[:, : chain.coordinates] = 1e6 * compliance * torques
                column = 1e6 * column
            np.testing.assert_allclose(column, expected, rtol=0, atol=1e-12)
            assert np.abs(expected).max() > 0.1


def test_link_weight_is_that_of_the_next_two_links_with_a_length(fanuc):
    named = {
        c.key: [int(p.name.split("_")[-1]) for p in c.parameters]
        for c in candidates_on(sites_of(fanuc.chain)).values()
        if c.effect == "link_weight" and not c.detail
    }
    joints = {"link_weight@2": [2, 3], "link_weight@3": [3, 6], "link_weight@4": [6], "link_weight@5": [6]}
    assert named == {"link_weight": [2, 3]} | joints


def test_link_weight_of_the_arm_may_be_that_of_all_links_with_a_length(fanuc):
    whole = candidate_on(fanuc.chain, "link_weight[all links]")
    masses = [int(p.name.split("_")[-1]) for p in whole.parameters if p.unit == "kg"]
    moments = [p.name for p in whole.parameters if p.unit == "kg m"]
    assert masses == [2, 3, 6] and whole.location == ("arm",)
    assert moments == [f"moment_{name}" for name in ("z_of_link_2", "z_of_link_3", "y_of_link_6", "z_of_link_6")]
    # One finding with that of two links: a model has one of these laws.
    assert (
        candidate_on(fanuc.chain, "link_weight").location
        == whole.location
        != candidate_on(fanuc.chain, "link_weight@2").location
    )


def test_centres_of_mass_off_the_line_count_where_they_can_turn_the_joint(fanuc):
    """Joints 2 and 3 turn about y: what is off along y hangs on their axes."""
    named = {
        c.joints[0]: [p.name.removeprefix("compliance_times_moment_") for p in c.parameters if "moment" in p.name]
        for c in candidates_on(sites_of(fanuc.chain)).values()
        if c.effect == "link_weight" and c.detail == "off the line" and c.joints
    }
    # Link 6 has a length along x and turns with joint 6, so that its y and z turn every joint but those about x.
    assert named == {
        2: ["z_of_link_2", "z_of_link_3"],
        3: ["z_of_link_3", "y_of_link_6", "z_of_link_6"],
        4: ["y_of_link_6", "z_of_link_6"],
        5: ["y_of_link_6", "z_of_link_6"],
    }


def test_arm_stretched_out_sags_by_its_weight_as_calculated_by_hand():
    # 1 kg at the end of 2 m, about -y in this chain's sense: the joint turns by +c m g l about y, downwards.
    chain = chain_of("Ry(q1) Tx(2) [end]")
    states = made_states(1, 1)
    states.joint_angles[:] = 0.0
    around = conditions_on(chain, states)
    made = displacements(candidate_on(chain, "link_weight@1"), around)
    np.testing.assert_allclose(made[0, 0, 0], 2 * GRAVITY, rtol=1e-14)


@pytest.mark.parametrize("name", ["fanuc", "ur10", "fixed rotations"])
def test_payload_is_the_gravity_of_a_body_at_the_flange_by_pinocchio(name, fanuc):
    chain = fanuc.chain if name == "fanuc" else chain_of(OTHER_CHAINS[name])
    states = made_states(chain.coordinates, 5, seed=2, span=3.0)
    compliance = 1e-6 * np.arange(1, chain.coordinates + 1)
    around = conditions_on(chain, states, compliance)
    mass, centre = 7.5, np.array([0.12, -0.07, 0.3])
    made = np.tensordot([mass, *(mass * centre)], displacements(candidate_on(chain, "payload"), around), axes=1)
    torque = gravity_torques(chain, states.joint_angles, chain.end_effector.after, mass, centre)
    np.testing.assert_allclose(made[:, : chain.coordinates], torque * compliance, rtol=0, atol=1e-16)
    assert not made[:, chain.coordinates :].any()
    assert np.abs(torque).max() > 10


def test_payload_hangs_at_the_flange_whatever_target_sits_there(fanuc):
    moved = replace(fanuc.chain, points=tuple(replace(p, offset_m=(0.2, 0.3, 0.4)) for p in fanuc.chain.points))
    states = made_states(6, 5, seed=3)
    ours, theirs = (displacements(candidate_on(c, "payload"), conditions_on(c, states)) for c in (moved, fanuc.chain))
    np.testing.assert_array_equal(ours, theirs)


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


def test_compensator_torque_is_in_waves_of_the_shoulder(fanuc):
    states = made_states(6, 5, seed=5)
    candidate = candidate_on(fanuc.chain, "compensator_torque@2")
    q = states.joint_angles[:, 1]
    expected = [np.cos(q), np.sin(q), np.cos(2 * q), np.sin(2 * q)]
    assert [p.name for p in candidate.parameters] == ["cos_1q", "sin_1q", "cos_2q", "sin_2q"]
    made = displacements(candidate, conditions_on(fanuc.chain, states))
    np.testing.assert_allclose(made[:, :, 1], expected, atol=1e-15)


def predicted(chain, key, values, states):
    """Position and rotation of the last point of a stiff robot with one effect."""
    target = (Target("A", chain.end_effector.name, (0.0, 0.0, 0.0)),)
    candidate = candidate_on(chain, key)
    model = made_model(chain, target, 6, fitted_frames=False, compliance=np.zeros(chain.coordinates), effects=(candidate,))
    estimate = replace(made_estimate(model), coefficients=(np.array(values, float),))
    return predict(model, estimate, seen_exactly(model, estimate, states), conditions(model, estimate, states))


@pytest.mark.parametrize("joint", range(1, 7))
def test_joint_offset_is_the_pose_at_the_angle_with_the_offset(joint, fanuc):
    states = made_states(6, 5, seed=6)
    found = predicted(fanuc.chain, f"joint_offset@{joint}", [0.01], states)
    expected = poses(fanuc.chain, states.joint_angles + 0.01 * np.eye(6)[joint - 1], fanuc.chain.end_effector)
    for ours, theirs in zip(found, expected, strict=True):
        np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-14)


ARM = "Tz({a}) Rz(q1) Tx({b}) Ry(q2) Tx({c}) Ty({d}) Rz({e}deg) Ry(q3) Tx({f}) [end]"
RIGHT = {"a": 0.4, "b": 0.1, "c": 0.7, "d": 0.2, "e": 30, "f": 0.5}


@pytest.mark.parametrize(
    ("wrong", "key", "values"),
    [
        ({"b": 0.103}, "link_geometry@1", [0.003, 0, 0, 0, 0, 0]),
        # Behind the turn of 30 degrees, the chain's x axis there is the link's turned one.
        ({"c": 0.702}, "link_geometry@2", [0.002 * np.cos(np.pi / 6), -0.002 * np.sin(np.pi / 6), 0, 0, 0, 0]),
        ({"d": 0.199}, "link_geometry@2", [-0.001 * np.sin(np.pi / 6), -0.001 * np.cos(np.pi / 6), 0, 0, 0, 0]),
        ({"e": 31}, "link_geometry@2", [0, 0, 0, 0, 0, np.pi / 180]),
        ({"f": 0.51}, "link_geometry@3", [0.01, 0, 0, 0, 0, 0]),
    ],
)
def test_link_geometry_is_the_chain_with_other_dimensions(wrong, key, values):
    states = made_states(3, 5, seed=7)
    other = robot_of(ARM.format(**{**RIGHT, **wrong})).chain
    found = predicted(chain_of(ARM.format(**RIGHT)), key, values, states)
    for ours, theirs in zip(found, poses(other, states.joint_angles, other.end_effector), strict=True):
        np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-14)


# The last joint turns about each axis in turn, in both senses, with a link behind it that is turned against it.
WRISTS = {
    "about x": "Tz(0.4) Rz(q1) Tx(0.3) Ry(q2) Tx(0.5) Rx(-q3) Tx(0.1) Rz(40deg) Ty(0.05) [end]",
    "about y": "Tz(0.4) Rz(q1) Tx(0.3) Rx(q2) Tx(0.5) Ry(q3) Rx(-70deg) Tx(0.1) [end]",
    "about z": "Tz(0.4) Ry(q1) Tx(0.3) Ry(-q2) Tx(0.5) Rz(q3) Tx(0.1) Ry(25deg) [end]",
}


@pytest.mark.parametrize("name", WRISTS)
def test_reflector_in_an_eccentric_nest_circles_twice_a_turn_across_the_last_joint(name):
    """Exact, in the frame that turns with the joint; nothing turns."""
    chain = chain_of(WRISTS[name])
    states = made_states(3, 7, seed=8, span=3.0)
    values = np.array([2e-4, -1e-4, 3e-4, 5e-5])
    position, rotation = predicted(chain, "nest_eccentricity", values, states)
    still = poses(chain, states.joint_angles, chain.end_effector)
    wrist = next(index for index, t in enumerate(chain.transforms) if t.coordinate == 2)
    behind = poses(chain, states.joint_angles, MeasuringPoint("behind", wrist + 1))[1]
    across = [axis for axis in range(3) if axis != chain.transforms[wrist].axis]
    twice = 2 * states.joint_angles[:, 2]
    circle = np.zeros((7, 3))
    circle[:, across[0]] = values[0] * np.cos(twice) + values[1] * np.sin(twice)
    circle[:, across[1]] = values[2] * np.cos(twice) + values[3] * np.sin(twice)
    np.testing.assert_allclose(position - still[0], np.einsum("sij,sj->si", behind, circle), rtol=0, atol=1e-14)
    np.testing.assert_allclose(rotation, still[1], rtol=0, atol=1e-14)


def test_eccentric_nest_of_the_plant_is_in_the_catalogue(fanuc):
    states = made_states(6, 7, seed=9, span=3.0)
    still = poses(fanuc.chain, states.joint_angles, fanuc.chain.end_effector)
    expected = EccentricNest(1e-4).moved(*still, states.joint_angles[:, 5])
    names = [p.name for p in candidate_on(fanuc.chain, "nest_eccentricity").parameters]
    values = [1e-4 if name in ("cos_y_2q", "sin_z_2q") else 0.0 for name in names]
    np.testing.assert_allclose(predicted(fanuc.chain, "nest_eccentricity", values, states)[0], expected, rtol=0, atol=1e-14)


def test_nest_is_no_candidate_where_the_last_joint_does_not_turn():
    """A reflector that a slide carries keeps its side to the tracker: there is no angle that it could circle with."""
    scara = chain_of("Tz(0.4) Rz(q1) Tx(0.4) Rz(q2) Tx(0.3) Tz(-q3) [end]")
    assert not any(c.effect == "nest_eccentricity" for c in candidates_on(sites_of(scara)).values())
    turning = chain_of("Tz(0.4) Rz(q1) Tx(0.4) Tz(-q2) Tx(0.3) Rz(q3) [end]")
    assert any(c.effect == "nest_eccentricity" for c in candidates_on(sites_of(turning)).values())
