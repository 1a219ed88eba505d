"""Load by which the laws of gears are scaled: levers and weights by hand."""

from dataclasses import replace

import numpy as np
import pytest
from support import chain_of
from synthetic import equipped

from elastocal.effects.full_load import full_torque_Nm, lever_m
from elastocal.mechanics.robot import Mass


def test_the_full_torque_has_the_lever_of_a_tool_at_least_and_the_weight_behind_the_joint():
    """Levers of the outstretched arm, by hand; the weight of a mass half way along its link."""
    sites = equipped(chain_of("Rz(q1) Tz(1) Ry(q2) Tx(2) Ry(q3) Tx(0.1) [hand]"))
    assert [lever_m(sites, joint) for joint in range(3)] == pytest.approx([3.1, 2.1, 0.5])
    g = np.linalg.norm(sites.gravity_m_s2)
    # Eight kilograms a cubic metre of reach suit an arm whose rated load is not known.
    assert [full_torque_Nm(sites, joint) for joint in range(3)] == pytest.approx(np.array([3.1, 2.1, 0.5]) * 8 * 3.1**3 * g)
    loaded = replace(sites, payload_kg=10.0, masses=(Mass(2, 30.0, (-1.0, 0.0, 0.0), 0.1),))
    # It turns joint 2 at a metre, and joint 1, whose axis stands upright, not at all; it is before joint 3.
    found = [full_torque_Nm(loaded, joint) for joint in range(3)]
    assert found[0] == pytest.approx(31 * g) and found[2] == pytest.approx(5 * g)
    # The longest lever is that of some poses, so almost that of the arm outstretched.
    assert 0.98 * 30 * g < found[1] - 21 * g <= 30 * g


@pytest.mark.parametrize("gravity", [(0.0, 0.0, -9.80665), (3.0, 0.0, 4.0)])
def test_a_rated_payload_pulls_by_its_weight_where_the_robot_stands(gravity):
    sites = equipped(chain_of("Rz(q1) Ry(q2) Tx(2) [hand]"))
    loaded = replace(sites, payload_kg=30.0, gravity_m_s2=gravity)
    assert full_torque_Nm(loaded, 1) == pytest.approx(30.0 * np.linalg.norm(gravity) * 2.0)
    assert full_torque_Nm(replace(sites, gravity_m_s2=gravity), 1) == pytest.approx(8 * 2.0**3 * np.linalg.norm(gravity) * 2.0)
