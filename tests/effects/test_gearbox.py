"""Gearboxes, beyond their closed forms: ranges, sizes and signs of their laws."""

from dataclasses import replace

import numpy as np
import pytest
from support import chain_of
from synthetic import candidate_on, conditions_on, displacements, equipped, made_states

from elastocal.effects.catalogue import candidates_on
from elastocal.effects.protocol import LOADED_JOINTS
from elastocal.mechanics.sites import sites_of


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
