"""Springs and bending links against closed forms, and repeats averaged."""

import numpy as np
import pandas as pd
import pytest
from scipy.integrate import quad
from scipy.spatial.transform import Rotation

from elastocal.campaigns.joint_space import configurations
from elastocal_proof.audit.audited import WRENCH
from elastocal_proof.audit.elastic import Robot, Springs, averages, far_off, find_configurations

BEAM = {"name": "beam", "chain": "Rz(q1) Tx(2.0) [tip]", "compliance_urad_per_Nm": [0.5]}
LENGTH, BENDING, TORSION = 2.0, 1e-6, 2e-6


def beam(taper=0.0, joint=0.0):
    robot = Robot(BEAM, [{"point": "tip", "offset_m": [0, 0, 0]}])
    return robot, robot.compliance(Springs(np.array([joint]), BENDING, TORSION, taper))


def test_a_uniform_link_is_a_cantilever():
    found = beam()[1][1:, 1:]
    # Shift by force, turn by force, turn by moment across; turn by moment along.
    assert found[1, 1] == pytest.approx(LENGTH**3 / 3 * BENDING)
    assert found[2, 2] == pytest.approx(found[1, 1])
    assert found[5, 1] == pytest.approx(LENGTH**2 / 2 * BENDING)
    assert found[4, 2] == pytest.approx(-(LENGTH**2) / 2 * BENDING)
    assert found[5, 5] == pytest.approx(LENGTH * BENDING)
    assert found[3, 3] == pytest.approx(LENGTH * TORSION)
    np.testing.assert_allclose(found, found.T)
    assert found[0, 0] == 0


def test_a_tapered_link_shifts_and_twists_as_the_uniform_one_and_turns_by_the_integral_of_its_compliance():
    taper, uniform = 0.4, beam()[1]
    found = beam(taper)[1]
    assert found[2, 2] == pytest.approx(uniform[2, 2]) and found[4, 4] == pytest.approx(uniform[4, 4])
    # Of (1 - s)^2 / (1 - t s)^3 and of 1 / (1 - t s)^3 from 0 to 1.
    shifting = quad(lambda s: (1 - s) ** 2 / (1 - taper * s) ** 3, 0, 1)[0]
    turning = ((1 - taper) ** -2 - 1) / (2 * taper)
    assert found[6, 6] == pytest.approx(LENGTH * BENDING * turning / (3 * shifting))


def test_short_links_do_not_bend():
    robot = Robot(BEAM | {"chain": "Rz(q1) Tx(0.04) [tip]"}, [{"point": "tip", "offset_m": [0, 0, 0]}])
    assert not robot.compliance(Springs(np.zeros(1), BENDING))[1:].any()


def test_a_joint_yields_to_the_load_where_it_has_turned_to():
    robot, compliance = beam(joint=1e-4)
    force = np.array([0, 1000.0, 0, 0, 0, 0])
    coordinates, forces = robot.loaded(compliance, np.zeros(1), force)
    np.testing.assert_allclose(coordinates, compliance @ forces, rtol=1e-6)
    # The lever is shorter there than at the commanded pose, where the torque is force times length.
    assert forces[0] == pytest.approx(2000 * np.cos(coordinates[0]), rel=1e-3)
    assert forces[0] < 1990


def table(rows=4, far=None):
    draws = np.random.default_rng(1)
    position = np.array([1.0, 2.0, 3.0]) + 1e-4 * draws.normal(size=(rows, 3))
    if far is not None:
        position[far, 1] += 0.01
    turned = Rotation.from_rotvec(1e-4 * draws.normal(size=(rows, 3))) * Rotation.from_rotvec([0.3, -0.4, 0.5])
    frame = pd.DataFrame(position, columns=list("xyz")).assign(session=0, pose=3, load=1, target=0, q1=0.1)
    frame[["rx", "ry", "rz"]] = turned.as_rotvec()
    return frame.assign(**dict.fromkeys(WRENCH, 5.0)), turned


def test_repeats_are_averaged():
    frame, turned = table()
    seen = averages(frame, True)
    np.testing.assert_allclose(seen.position, [frame[list("xyz")].mean()])
    mean = Rotation.from_matrix(seen.rotation[0])
    assert (mean * turned.mean().inv()).magnitude() < 1e-8
    assert seen.repeats.tolist() == [4] and seen.pose.tolist() == [0] and seen.states["q1"].tolist() == [0.1]


def test_a_repeat_far_from_the_others_is_left_out():
    frame, _ = table(far=2)
    assert far_off(frame).tolist() == [False, False, True, False]
    assert averages(frame, False).repeats.tolist() == [3]
    # Of two nothing tells which.
    assert not far_off(table(2, far=1)[0]).any()


def test_configurations_are_those_that_hold_out_goes_by():
    rng = np.random.default_rng(1)
    angles = np.concatenate([rng.uniform(-0.1, 0.1, (60, 3)), np.linspace(0.0, 1.0, 60)[:, None] * [1.0, 0.0, 0.0]])
    found = find_configurations(angles)
    np.testing.assert_array_equal(found, configurations(angles, np.arange(120)))
    assert 10 < found.max() < 119
