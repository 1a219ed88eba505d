"""Effects that are periodic in a joint angle: known ratios, and orders between integers."""

from dataclasses import replace

import numpy as np
import pytest
from support import chain_of
from synthetic import (
    conditions_on,
    displacements,
    equipped,
    make_states,
)

from elastocal.effects.catalogue import candidates_on


def test_orders_between_two_integers_are_found(fanuc):
    candidates = candidates_on(equipped(fanuc))
    states = make_states(6, 5, seed=3)
    bands = [
        c
        for c in candidates.values()
        if c.effect == "transmission_order" and c.joints == (3,)
    ]
    for above, band in enumerate(bands, 1):
        (shape,) = band.shapes
        assert (
            above
            < shape.lowest
            < shape.start
            == above + 0.5
            < shape.highest
            < above + 1
        )
        np.testing.assert_array_equal(shape.values(3), [above + 0.5])
        assert band.distinct_angles == 4 * (above + 1)
    assert len(bands) == 17 and len({band.location for band in bands}) == 17
    around = conditions_on(fanuc, states)
    made = displacements(bands[1], around, 2.7)
    angle = states.joint_angles[:, 2]
    np.testing.assert_allclose(
        made[:, :, 2],
        [wave(k * angle) for k in (2.7, 5.4) for wave in (np.cos, np.sin)],
        rtol=1e-13,
    )


# An arm of two metres that turns about the vertical; eight kilograms a cubic metre of
# reach suit it.
TURNTABLE = "Rz(q1) Tx(2) [hand]"
FULL_NM = 8.0 * 2.0**3 * 9.80665 * 2.0


@pytest.mark.parametrize(
    ("key", "lowest", "start", "highest"),
    [
        ("lost_motion@1", 0.003, 0.03, 0.1),
        ("stiffening@1", 0.05, 0.3, 0.8),
        ("stiffening@1[two slopes]", 0.05, 0.3, 0.8),
    ],
)
@pytest.mark.parametrize("payload_kg", [None, 100.0])
def test_torques_of_gear_laws_are_shares_of_the_full_torque(
    key, lowest, start, highest, payload_kg
):
    """Lost motion is read at 3 % of it. Of a kilonewton, or of the rated payload, two
    metres away."""
    sites = replace(equipped(chain_of(TURNTABLE)), payload_kg=payload_kg)
    (shape,) = candidates_on(sites)[key].shapes
    full = (
        FULL_NM
        if payload_kg is None
        else 2.0 * payload_kg * np.linalg.norm(sites.gravity_m_s2)
    )
    assert (shape.lowest, shape.start, shape.highest) == pytest.approx(
        (lowest * full, start * full, highest * full)
    )
    assert (shape.name, shape.unit, shape.tried) == ("torque", "N m", 0)
