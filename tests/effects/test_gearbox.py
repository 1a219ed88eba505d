"""Gearboxes, beyond their closed forms: ranges, sizes and signs of their laws."""

from dataclasses import replace

import numpy as np
import pytest
from support import chain_of
from synthetic import candidate_on, equipped

from elastocal.effects.catalogue import candidates_on
from elastocal.effects.protocol import LOADED_JOINTS


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
