"""Gearboxes and transmissions: laws of a joint's own torque, angle and approach, by their formulas."""

from dataclasses import replace

import numpy as np
import pytest
from support import OTHER_CHAINS, TRACK, PinocchioPoint, chain_of
from synthetic import candidate_on, conditions_on, displacements, equipped, made_states

from elastocal.effects import transmission_harmonic
from elastocal.effects.catalogue import candidates_on
from elastocal.effects.protocol import LOADED_JOINTS
from elastocal.mechanics.sites import sites_of

COUNT = 6


@pytest.fixture(params=["fanuc", "ur10", "fixed rotations"])
def case(request, fanuc):
    """Chain, conditions and torques of the joints by pinocchio."""
    chain = fanuc.chain if request.param == "fanuc" else chain_of(OTHER_CHAINS[request.param])
    states = made_states(chain.coordinates, COUNT, seed=1, force=100.0)
    model = PinocchioPoint(chain, chain.end_effector)
    torque = [model.pose_and_jacobian(q)[2].T @ w for q, w in zip(states.joint_angles, states.wrench, strict=True)]
    return chain, conditions_on(chain, states), np.array(torque)


def assert_only(made, joint, expected):
    """A joint moves as expected and nothing else does."""
    whole = np.zeros_like(made)
    whole[..., joint] = expected
    np.testing.assert_allclose(made, whole, rtol=1e-9, atol=1e-12)


def test_smooth_stiffening_is_the_cube_of_torques_that_are_small(case):
    chain, around, torque = case
    large = 300.0 * np.abs(torque).max()
    for joint in range(chain.coordinates):
        made = displacements(candidate_on(chain, f"stiffening@{joint + 1}"), around, large)
        expected = np.zeros_like(made)
        expected[..., joint] = torque[:, joint] ** 3 / (3 * large**2)
        np.testing.assert_allclose(made, expected, rtol=1e-4, atol=1e-9 * np.abs(torque).max())


def test_smooth_stiffening_has_the_slope_of_two_slopes_where_torques_are_large(case):
    chain, around, _ = case
    for joint in range(chain.coordinates):
        laws = (candidate_on(chain, f"stiffening@{joint + 1}{detail}") for detail in ("", "[two slopes]"))
        smooth, kinked = (displacements(law, around, 1e-3)[..., joint] for law in laws)
        np.testing.assert_allclose(smooth, kinked, rtol=0, atol=1e-3)


@pytest.mark.parametrize("meeting", [5.0, 50.0, 400.0])
def test_stiffening_with_two_slopes_begins_where_they_meet(case, meeting):
    chain, around, torque = case
    beyond = np.sign(torque) * np.maximum(np.abs(torque) - meeting, 0.0)
    for joint in range(chain.coordinates):
        made = displacements(candidate_on(chain, f"stiffening@{joint + 1}[two slopes]"), around, meeting)
        assert_only(made, joint, beyond[:, joint])


def test_stiffening_takes_half_of_the_compliance_of_a_gear(fanuc):
    for joint, compliance in enumerate(fanuc.compliance, 1):
        for detail in ("", "[two slopes]"):
            (beyond,) = candidates_on(sites_of(fanuc))[f"stiffening@{joint}{detail}"].parameters
            assert (beyond.plausible, beyond.sign) == (pytest.approx(0.5 * compliance), -1)


def test_play_is_mostly_taken_up_before_the_slopes_of_a_stiffening_gear_meet(fanuc):
    """Where both laws reach they are one, for two slopes are play and a spring: it shall be a small part of either range."""
    for joint in range(1, 7):
        (taken_up,), (meeting,) = (
            candidate_on(fanuc.chain, f"{name}").shapes for name in (f"lost_motion@{joint}", f"stiffening@{joint}[two slopes]")
        )
        assert taken_up.lowest < taken_up.start < meeting.lowest < taken_up.highest < meeting.start < meeting.highest
        both = np.log(taken_up.highest / meeting.lowest)
        assert all(both < 0.3 * np.log(shape.highest / shape.lowest) for shape in (taken_up, meeting))


@pytest.mark.parametrize("taken_up", [5.0, 50.0, 400.0])
def test_lost_motion_is_crossed_where_the_torque_changes_its_sign(case, taken_up):
    chain, around, torque = case
    for joint in range(chain.coordinates):
        made = displacements(candidate_on(chain, f"lost_motion@{joint + 1}"), around, taken_up)
        assert_only(made, joint, np.tanh(torque[:, joint] / taken_up))


def test_lost_motion_is_never_more_than_half_its_play_either_way(fanuc):
    around = conditions_on(fanuc.chain, made_states(6, 20, force=1e5))
    made = displacements(candidate_on(fanuc.chain, "lost_motion@2"), around, 5.0)[0, :, 1]
    np.testing.assert_allclose(np.abs(made), 1.0, atol=1e-6)


def test_hysteresis_is_the_sense_of_approach_of_the_joint(case):
    chain, around, _ = case
    for joint in range(chain.coordinates):
        made = displacements(candidate_on(chain, f"hysteresis@{joint + 1}"), around)
        assert_only(made, joint, around.approach[:, joint])


def test_harmonics_are_cosines_and_sines_of_multiples_of_the_angle(case):
    chain, around, _ = case
    orders = {joint: [] for joint in range(chain.coordinates)}
    for candidate in candidates_on(around.sites).values():
        if candidate.effect != "transmission_harmonic":
            continue
        (joint,) = (number - 1 for number in candidate.joints)
        made = displacements(candidate, around)
        for column, parameter in zip(made, candidate.parameters, strict=True):
            wave, order = parameter.name.split("_")
            order = int(order.removesuffix("q"))
            assert_only(column, joint, {"cos": np.cos, "sin": np.sin}[wave](order * around.joint_angles[:, joint]))
            orders[joint].append((order, wave))
        # Four samples a period of its shortest wave.
        assert candidate.distinct_angles == 4 * max(order for order, _ in orders[joint])
    expected = [(order, wave) for order in range(1, 37) for wave in ("cos", "sin")]
    assert all(found == expected for found in orders.values())


def test_ratio_is_linear_in_the_angle_of_the_joint_and_of_the_one_before(case):
    chain, around, _ = case
    for joint in range(chain.coordinates):
        candidate = candidate_on(chain, f"transmission_ratio@{joint + 1}")
        sources = [joint] if joint == 0 else [joint, joint - 1]
        assert [p.name for p in candidate.parameters] == [f"per_q{source + 1}" for source in sources]
        for column, source in zip(displacements(candidate, around), sources, strict=True):
            assert_only(column, joint, around.joint_angles[:, source])


# An arm of two metres that turns about the vertical; eight kilograms a cubic metre of reach suit it.
TURNTABLE, FULL_NM = "Rz(q1) Tx(2) [hand]", 8.0 * 2.0**3 * 9.80665 * 2.0


def under(torques, approach=None):
    """Conditions in which the one joint of the turntable bears exactly these torques, N m."""
    chain, torques = chain_of(TURNTABLE), np.asarray(torques, float)
    states = made_states(1, len(torques), seed=3)
    wrench = np.zeros((len(torques), 6))
    wrench[:, 5] = torques
    sense = states.approach if approach is None else np.asarray(approach, float)[:, None]
    return conditions_on(chain, replace(states, wrench=wrench, approach=sense))


def law_of(key, torques, *shapes):
    """What the unit of a law makes of the joint of the turntable."""
    return displacements(candidate_on(chain_of(TURNTABLE), key), under(torques), *shapes)[0, :, 0]


@pytest.mark.parametrize("taken_up", [6.0, 60.0, 200.0])
def test_lost_motion_is_three_quarters_taken_up_at_its_torque_and_a_straight_line_below(taken_up):
    knee = (np.e**2 - 1) / (np.e**2 + 1)
    torques = taken_up * np.array([-30.0, -1.0, -1e-4, 0.0, 1e-4, 1.0, 30.0])
    np.testing.assert_allclose(
        law_of("lost_motion@1", torques, taken_up), [-1.0, -knee, -1e-4, 0.0, 1e-4, knee, 1.0], rtol=1e-7, atol=1e-15
    )


def test_two_slopes_meet_at_their_torque_without_a_step_and_differ_by_one_unit_of_slope():
    near = 1e-6
    torques = 300.0 * np.array([-2.0, -1.0 - near, -1.0, -1.0 + near, 0.0, 1.0 - near, 1.0, 1.0 + near, 2.0])
    expected = 300.0 * np.array([-1.0, -near, 0.0, 0.0, 0.0, 0.0, 0.0, near, 1.0])
    np.testing.assert_allclose(law_of("stiffening@1[two slopes]", torques, 300.0), expected, rtol=0, atol=1e-9)


def test_smooth_stiffening_leaves_a_quarter_of_the_torque_at_which_the_slopes_meet():
    """At the knee tau - tau tanh(1); far beyond it the torque less that of the knee."""
    left = 2 / (np.e**2 + 1)
    torques = 300.0 * np.array([-40.0, -1.0, 0.0, 1.0, 40.0])
    expected = 300.0 * np.array([-39.0, -left, 0.0, left, 39.0])
    np.testing.assert_allclose(law_of("stiffening@1", torques, 300.0), expected, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("key", ["lost_motion@1", "stiffening@1", "stiffening@1[two slopes]"])
@pytest.mark.parametrize("shape", [5.0, 300.0, 1600.0])
def test_laws_of_torque_change_their_sign_with_it_and_never_fall(key, shape):
    torques = np.sort(np.random.default_rng(4).uniform(-3000.0, 3000.0, 200))
    torques = np.concatenate([torques, 1e-3 * torques, [shape, -shape, 0.0]])
    made, mirrored = law_of(key, torques, shape), law_of(key, -torques, shape)
    np.testing.assert_array_equal(mirrored, -made)
    assert (np.diff(made[np.argsort(torques)]) >= -1e-9).all()
    # Play is never crossed by more than all of it; a gear never yields by more than its torque.
    assert (np.abs(made) <= (1.0 if key.startswith("lost") else np.abs(torques))).all()


@pytest.mark.parametrize(
    ("key", "lowest", "start", "highest"),
    [
        ("lost_motion@1", 0.003, 0.03, 0.1),
        ("stiffening@1", 0.05, 0.3, 0.8),
        ("stiffening@1[two slopes]", 0.05, 0.3, 0.8),
    ],
)
@pytest.mark.parametrize("payload_kg", [None, 100.0])
def test_torques_of_laws_are_shares_of_the_full_torque_of_the_joint(key, lowest, start, highest, payload_kg):
    """Lost motion is read at 3 % of it. Of a kilonewton, or of the rated payload, two metres away."""
    sites = replace(equipped(chain_of(TURNTABLE)), payload_kg=payload_kg)
    (shape,) = candidates_on(sites)[key].shapes
    full = FULL_NM if payload_kg is None else 2.0 * payload_kg * np.linalg.norm(sites.gravity_m_s2)
    assert (shape.lowest, shape.start, shape.highest) == pytest.approx((lowest * full, start * full, highest * full))
    assert (shape.name, shape.unit, shape.tried) == ("torque", "N m", 0)


@pytest.mark.parametrize(
    ("key", "name", "unit", "plausible", "sign", "needs"),
    [
        # Play opens with the torque and a gear gets stiffer with it; friction may hold back either way.
        ("lost_motion@1", "half_play", "rad", 1e-4, 1, LOADED_JOINTS),
        ("stiffening@1", "beyond", "rad/(N m)", 1e-3 / FULL_NM, -1, LOADED_JOINTS),
        ("stiffening@1[two slopes]", "beyond", "rad/(N m)", 1e-3 / FULL_NM, -1, LOADED_JOINTS),
        ("hysteresis@1", "half_width", "rad", 1e-4, 0, {"approach"}),
    ],
)
def test_each_law_of_a_gear_has_one_parameter_of_known_size_and_sign(key, name, unit, plausible, sign, needs):
    candidate = candidate_on(chain_of(TURNTABLE), key)
    (parameter,) = candidate.parameters
    assert (parameter.name, parameter.unit, parameter.sign) == (name, unit, sign)
    assert parameter.plausible == pytest.approx(plausible) and parameter.prior_std is None
    assert candidate.needs == needs and candidate.joints == (1,) and candidate.family == "gearbox"


def test_hysteresis_has_the_sign_of_the_approach_and_is_nothing_where_a_joint_was_not_moved():
    chain, senses = chain_of(TURNTABLE), [-1.0, 0.0, 1.0]
    made = displacements(candidate_on(chain, "hysteresis@1"), under([100.0, -50.0, 0.0], senses))
    np.testing.assert_array_equal(made[0, :, 0], senses)


def test_a_track_has_friction_in_metres_and_no_gear_that_turns():
    found = candidates_on(equipped(chain_of(TRACK)))
    units = {key: c.parameters[0].unit for key, c in found.items() if c.effect == "hysteresis"}
    assert units == {"hysteresis@1": "m"} | {f"hysteresis@{joint}": "rad" for joint in (2, 3, 4)}
    assert found["hysteresis@1"].parameters[0].plausible == 2e-5
    for effect, count in (("lost_motion", 1), ("stiffening", 2)):
        joints = [c.joints for c in found.values() if c.effect == effect]
        assert joints == [(2,), (3,), (4,)] * count


def test_bands_of_orders_of_one_gear_are_different_locations(kuka):
    """Two bands are two terms of one mechanism and may both be there, which alternatives of one location may not."""
    found = transmission_harmonic.candidates(sites_of(kuka))
    assert len({candidate.location for candidate in found}) == len(found)
    assert {candidate.location[0] for candidate in found} == {1, 2, 3, 4, 5, 6}
