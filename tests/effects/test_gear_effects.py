"""Gearboxes and transmissions: laws of a joint's own torque, angle and approach, by their formulas."""

import numpy as np
import pytest
from support import OTHER_CHAINS, PinocchioPoint, chain_of
from synthetic import candidate_on, circumstances_on, displacements, made_states

from elastocal.effects.catalogue import candidates_on

COUNT = 6


@pytest.fixture(params=["fanuc", "ur10", "fixed rotations"])
def case(request, fanuc):
    """Chain, conditions and torques of the joints by pinocchio."""
    chain = fanuc.chain if request.param == "fanuc" else chain_of(OTHER_CHAINS[request.param])
    states = made_states(chain.coordinates, COUNT, seed=1, force=100.0)
    model = PinocchioPoint(chain, chain.end_effector)
    torque = [model.pose_and_jacobian(q)[2].T @ w for q, w in zip(states.joint_angles, states.wrench, strict=True)]
    return chain, circumstances_on(chain, states), np.array(torque)


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


def test_plausible_stiffening_moves_the_end_of_the_arm_alike_at_every_joint():
    """Five millimetres under a kilonewton across the arm outstretched; a tool is at least half a metre long."""
    chain = chain_of("Rz(q1) Tz(1) Ry(q2) Tx(2) Ry(q3) Tx(0.1) [hand]")
    for joint, lever in enumerate((3.1, 2.1, 0.5), 1):
        for detail in ("", "[two slopes]"):
            (beyond,) = candidate_on(chain, f"stiffening@{joint}{detail}").parameters
            assert beyond.plausible * (1e3 * lever) * lever == pytest.approx(5e-3), joint


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
    around = circumstances_on(fanuc.chain, made_states(6, 20, force=1e5))
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
