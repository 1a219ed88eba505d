"""Usual values against published ones, and by hand."""

import numpy as np
import pytest

from elastocal.io.documents import read_document
from elastocal.mechanics.chain import parse_chain
from elastocal.mechanics.robot_file import robot_from_document
from elastocal.mechanics.usual_values import usual_compliance, usual_payload_kg


@pytest.mark.parametrize("name", ["kuka", "fanuc", "fanuc_measured"])
def test_published_compliances_are_within_a_factor_of_five_of_the_usual_ones(name, config_folder):
    robot = robot_from_document(read_document(config_folder / "robots" / f"{name}.yaml"))
    ratio = robot.compliance / usual_compliance(robot.chain, robot.payload_kg)
    assert (np.maximum(ratio, 1 / ratio) < 5).all()


def test_a_gear_winds_up_by_two_milliradians_under_the_rated_load_at_the_longest_lever():
    chain = parse_chain("Tz(9) Rz(q1) Tx(1.5) Ry(90deg) Ry(q2) Tz(-0.5) Rx(q3) Tx(0.1) [E]", {}, "x")
    expected = 2e-3 / (10 * 9.80665 * np.array([2.1, 0.6, 0.2]))
    np.testing.assert_allclose(usual_compliance(chain, 10.0), expected, rtol=1e-12)
    assert usual_payload_kg(chain) == pytest.approx(8 * 2.1**3)
    np.testing.assert_allclose(usual_compliance(chain), usual_compliance(chain, 8 * 2.1**3), rtol=1e-12)
